/** Numbers, times and names as people read them. Every quantity has its unit. */

export const THIN = "\u202f";
const NONE = "–";
const DIGITS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

/** To some significant digits, with a true minus. */
export function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE;
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return scientific(value, Math.min(digits, 3));
  return minus(String(Number(value.toPrecision(digits))));
}

/** To some decimals, so that columns line up. */
export function fixed(value, decimals = 2) {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE;
  const text = value.toFixed(decimals);
  return minus(Number(text) === 0 ? text.replace("-", "") : text);
}

/** With a sign, and none for what rounds to zero. */
export function signed(value, decimals = 1) {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE;
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : minus(value > 0 ? `+${text}` : text);
}

function scientific(value, digits) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  const power = [...exponent.replace("+", "")].map((digit) => DIGITS[digit]).join("");
  return `${minus(mantissa)}×10${power}`;
}

const minus = (text) => text.replace("-", "−");

/** A unit of the wire as it is printed. */
export function unit(wire) {
  return { "V2 s": "V²s", 1: "" }[wire] ?? wire;
}

/** A number with its unit. */
export function quantity(value, wire, digits = 4) {
  const printed = unit(wire);
  return printed === "" || value === null || value === undefined
    ? number(value, digits)
    : `${number(value, digits)}${THIN}${printed}`;
}

/** Quantities of one column: the same decimals, so that they can be compared. @param {number[]} values @returns {string[]} */
export function aligned(values, wire, digits = 4) {
  const largest = Math.max(...values.map(Math.abs));
  const decimals = largest > 0 ? Math.min(6, Math.max(0, digits - 1 - Math.floor(Math.log10(largest)))) : 0;
  return values.map((value) => `${fixed(value, decimals)}${unit(wire) ? THIN : ""}${unit(wire)}`);
}

/** Seconds as people say them. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return NONE;
  if (seconds < 1) return `${Math.round(1000 * seconds)}${THIN}ms`;
  if (seconds < 60) return `${seconds < 10 ? seconds.toFixed(1) : Math.round(seconds)}${THIN}s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes}${THIN}min ${Math.round(seconds % 60)}${THIN}s`;
  return `${Math.floor(minutes / 60)}${THIN}h ${minutes % 60}${THIN}min`;
}

/** A moment, short when it was today. @param {string} iso */
export function moment(iso) {
  const when = new Date(iso);
  const today = when.toDateString() === new Date().toDateString();
  return when.toLocaleString(undefined, today ? { timeStyle: "medium" } : { dateStyle: "medium", timeStyle: "short" });
}

/** "1 task", "3 tasks". */
export const count = (n, noun) => `${n.toLocaleString("en")} ${noun}${n === 1 ? "" : "s"}`;

const STATES = { completed_with_failures: "done, with failures", succeeded: "done", dead: "lost" };
const METHODS = { own: "own design per task", two_step: "two-step", worst_case: "worst case" };
const STAGES = {
  codesign: "Co-design",
  reconcile: "Reconcile",
  motions: "Motions",
  shared_optimum: "Shared optimum",
  shared_motions: "Motions with the shared optimum",
};

export const stateName = (state) => STATES[state] ?? words(state);
export const methodName = (method) => METHODS[method] ?? words(method);
export const stageName = (stage) => STAGES[stage] ?? words(stage);
export const words = (name) => name.replaceAll("_", " ");

const FINAL = new Set(["succeeded", "completed_with_failures", "failed", "cancelled"]);
export const isFinal = (state) => FINAL.has(state);
