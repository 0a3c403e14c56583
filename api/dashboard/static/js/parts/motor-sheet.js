/** A motor's numbers: its lengths, what they make of it, and how far each limit is. */

import { h } from "../dom.js";
import { fixed, number, quantity, words } from "../format.js";
import { DIMENSION_NAMES, DIMENSIONS } from "../names.js";
import { symbol } from "./symbol.js";

const UNITS = [
  ["_Nm_per_A", "N m/A"],
  ["_kg_m2", "kg m²"],
  ["_ohm", "Ω"],
  ["_Wb", "Wb"],
  ["_Nm", "N m"],
  ["_kg", "kg"],
  ["_mm", "mm"],
  ["_H", "H"],
];

/** Lengths, with the bounds that bind. @param {any} sheet of one motor @param {any} bounds [low, high] by name, mm */
export function dimensionTable(sheet, bounds) {
  const rows = DIMENSIONS.map((name) => {
    const [low, high] = bounds[name];
    const side = ["min", "max"].find((end) => sheet.binding.includes(`${name}_${end}`));
    return [
      h("td", {}, symbol(name)),
      h("td", {}, DIMENSION_NAMES[name]),
      h("td", { class: "figure" }, fixed(sheet.dimensions_mm[name], 3)),
      h("td", { class: "figure" }, `${number(low)} … ${number(high)}`),
      h("td", { class: "binds" }, side ? `at ${side === "min" ? "lower" : "upper"} bound` : ""),
    ];
  });
  return table("Dimensions", ["", "Length", "Value [mm]", "Bounds [mm]", ""], rows);
}

/** Constraints with their slack. */
export function constraintTable(sheet) {
  const isBound = (name) => DIMENSIONS.some((d) => name === `${d}_min` || name === `${d}_max`);
  const rows = Object.entries(sheet.constraints)
    .filter(([name]) => !isBound(name))
    .map(([name, entry]) => [
      h("td", {}, words(name)),
      h("td", { class: "figure" }, quantity(entry.value, entry.unit)),
      h("td", { class: "figure" }, quantity(entry.limit, entry.unit)),
      h("td", { class: "figure" }, quantity(Math.abs(entry.slack) < 1e-6 ? 0 : entry.slack, entry.unit, 3)),
      h("td", { class: "binds" }, sheet.binding.includes(name) ? "binds" : ""),
    ]);
  return table("Constraints", ["Constraint", "Value", "Limit", "Slack", ""], rows);
}

/** What the lengths make of the motor. */
export function parameterTable(sheet) {
  const rows = Object.entries(sheet.parameters).map(([wire, value]) => {
    const [end, unit] = UNITS.find(([suffix]) => wire.endsWith(suffix)) ?? ["", ""];
    const name = end ? wire.slice(0, -end.length) : wire;
    return [h("td", {}, words(name)), h("td", { class: "figure" }, quantity(value, unit))];
  });
  return table("Parameters", ["Parameter", "Value"], rows);
}

function table(caption, heads, rows) {
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h("caption", { class: "visually-hidden" }, caption),
      h(
        "thead",
        {},
        h("tr", {}, heads.map((text) => (text ? h("th", { scope: "col", class: figure(text) }, text) : h("td")))),
      ),
      h("tbody", {}, rows.map((cells) => h("tr", {}, cells))),
    ),
  );
}

const figure = (text) => (/^(Value|Bounds|Limit|Slack)/.test(text) ? "figure" : null);
