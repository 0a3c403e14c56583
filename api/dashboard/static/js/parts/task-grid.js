/** The tasks of an application: strokes across and payloads down, or a list when they are no grid. */

import { h } from "../dom.js";
import { number, quantity } from "../format.js";
import { taskCell } from "./task-cell.js";

/** Columns from which on cells are drawn small. */
const MANY = 12;

/** @param {any} overview @returns {{element: HTMLElement, update: (overview: any, method: string, iterations: Map) => void}} */
export function taskGrid(overview) {
  const cells = overview.tasks.map((task) => taskCell(overview.application_id, task));
  const element = overview.grid ? table(overview.grid, cells) : list(overview.tasks, cells);
  return {
    element,
    update(next, method, iterations) {
      const scale = range(next, method);
      next.tasks.forEach((task, k) => {
        cells[k].update(task.outcomes[method], method, scale, iterations.get(`${method}/${task.index}`));
      });
    },
  };
}

/** Least and largest value of a method, for its colours. */
export function range(overview, method) {
  const values = overview.tasks.map((task) => task.outcomes[method]?.value).filter((value) => Number.isFinite(value));
  const high = Math.max(...values);
  const decimals = high > 0 && Number.isFinite(high) ? Math.max(0, 3 - Math.floor(Math.log10(high))) : 3;
  return { low: Math.min(...values), high, unit: overview.unit, decimals: Math.min(decimals, 6) };
}

/** Tasks run over payloads first. */
function table(grid, cells) {
  const payloads = grid.payload_kg;
  const rows = payloads.map((payload, j) => [payload, j]).reverse();
  const across = grid.stroke.map((stroke) => h("th", { scope: "col" }, number(stroke)));
  return h(
    "div",
    { class: `scroll${grid.stroke.length > MANY ? " many" : ""}`, tabindex: "0", role: "region", "aria-label": "Grid of tasks" },
    h(
      "table",
      { class: "grid-table" },
      h(
        "tbody",
        {},
        rows.map(([payload, j]) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, quantity(payload, "kg")),
            grid.stroke.map((_, i) => h("td", {}, cells[i * payloads.length + j].element)),
          ),
        ),
      ),
      h("tfoot", {}, h("tr", {}, h("th", { scope: "row" }, "stroke [rad]"), across)),
    ),
  );
}

function list(tasks, cells) {
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h("thead", {}, h("tr", {}, ["#", "Task", "Payload", "Result"].map((text) => h("th", { scope: "col" }, text)))),
      h(
        "tbody",
        {},
        tasks.map((task, k) =>
          h(
            "tr",
            {},
            h("td", {}, String(task.index)),
            h("td", { class: "name" }, task.name),
            h("td", {}, quantity(task.payload_kg, "kg")),
            h("td", {}, cells[k].element),
          ),
        ),
      ),
    ),
  );
}
