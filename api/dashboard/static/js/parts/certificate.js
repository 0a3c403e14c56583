/** What an independent replay found. Older results have fewer figures; what is absent is not shown. */

import { h } from "../dom.js";
import { number, quantity, words } from "../format.js";

/** @param {any} certificate */
export function certificateView(certificate) {
  if (!certificate) return h("p", { class: "empty" }, "No certificate.");
  const c = certificate;
  const tolerance = c.tolerance ?? {};
  const within = (limit, wire) => (limit === undefined ? "" : ` (tolerance ${quantity(limit, wire)})`);
  const lines = [
    ["Replay to the end position", c.replay_position_rad, (v) => quantity(v, "rad") + within(tolerance.position_rad, "rad")],
    ["Replay to the end speed", c.replay_speed_rad_s, (v) => quantity(v, "rad/s") + within(tolerance.speed_rad_s, "rad/s")],
    ["Largest excess over a limit", c.limit_violation, (v) => percent(v) + (tolerance.limit === undefined ? "" : ` (tolerance ${percent(tolerance.limit)})`)],
    ["Optimality (KKT residual)", c.kkt_residual, number],
    ["Constraint violation", c.constraint_violation, number],
    ["Electrical balance, residual", c.energy_balance?.electrical?.residual_J, (v) => quantity(v, "J")],
    ["Mechanical balance, residual", c.energy_balance?.mechanical?.residual_J, (v) => quantity(v, "J")],
    ["Transcription", c.scheme, (v) => [v, c.degree && `degree ${c.degree}`, c.intervals && `${c.intervals} intervals`].filter(Boolean).join(", ")],
    ["Control", typeof c.control === "string" ? c.control : null, words],
  ];
  const facts = lines
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([term, value, print]) => [h("dt", {}, term), h("dd", {}, print(value))]);
  return [verdict(c), h("dl", { class: "facts" }, facts), limits(c.limits), refinements(c.refinements), hash(c.input_hash)];
}

function verdict(c) {
  if (c.within_tolerance === null || c.within_tolerance === undefined) return null;
  if (c.within_tolerance) return h("p", {}, h("span", { class: "state", dataset: { state: "succeeded" } }, "✓ replay and limits within tolerance"));
  const why = c.as_requested ? "The transcription was asked for as it is; a finer one, or an accuracy, comes closer." : "";
  return h("p", { class: "notice" }, "The replay misses the tolerance. ", why);
}

function limits(found) {
  if (!found) return null;
  return h(
    "table",
    { class: "records tight" },
    h("thead", {}, h("tr", {}, ["Excess over", "at grid points", "between them"].map((text, k) => h("th", { scope: "col", class: k ? "figure" : null }, text)))),
    h(
      "tbody",
      {},
      Object.entries(found).map(([name, check]) =>
        h("tr", {}, h("td", {}, words(name)), [check.at_points, check.between_points].map((v) => h("td", { class: "figure" }, percent(v)))),
      ),
    ),
  );
}

function refinements(found) {
  if (!found?.length) return null;
  const text = (r) => `degree ${r.degree}, ${r.intervals} intervals: ${quantity(r.replay_position_rad, "rad")}`;
  return h("p", { class: "hint" }, "Refined: ", found.map(text).join("; then "));
}

const hash = (value) => (value ? h("p", { class: "hint" }, "Input ", h("code", {}, value.slice(0, 16)), "…") : null);
const percent = (share) => (share === null || share === undefined ? "–" : `${number(100 * share, 3)} %`);
