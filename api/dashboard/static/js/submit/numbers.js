/** Numbers as they are typed. What is none stays as it is, so that the server can say what it should have been. */

/** @param {string} text @returns {any} nothing when empty */
export function oneNumber(text) {
  const trimmed = text.trim();
  if (trimmed === "") return undefined;
  const value = Number(trimmed);
  return Number.isFinite(value) ? value : trimmed;
}

/** Separated by commas, semicolons or spaces; brackets may stand around. @param {string} text @returns {any[]} */
export function manyNumbers(text) {
  return text
    .replace(/^\s*\[|\]\s*$/g, "")
    .split(/[\s,;]+/)
    .filter(Boolean)
    .map(oneNumber);
}

/** A task by its index or its name. @param {string} text */
export function indexOrName(text) {
  const trimmed = text.trim();
  if (trimmed === "") return undefined;
  return /^\d+$/.test(trimmed) ? Number(trimmed) : trimmed;
}

/** Leave out what is not given. */
export function given(values) {
  return Object.fromEntries(Object.entries(values).filter(([, value]) => value !== undefined && value !== ""));
}
