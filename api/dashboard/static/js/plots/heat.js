/** Percentages over strokes and payloads, better and worse apart with every colour vision; the sign says it in words. */

import { h } from "../dom.js";
import { number, quantity, signed } from "../format.js";
import { applicationLink } from "../router.js";

/** Share of full colour from which on a cell's text changes colour. */
const STRONG = 0.775;

/** Percent of full colour: the same on every page, so that pages may be compared. The numbers go on. */
export const FULL = 20;

/**
 * @param {any} grid strokes and payloads; tasks run over payloads first
 * @param {Map<number, number>} percent by task
 * @param {1 | -1} good the sign that is better
 * @param {(task: number) => {text: string, label: string, query: object}} about what stands where there is no number
 */
export function heatMap(grid, percent, good, caption, about) {
  const payloads = grid.payload_kg;
  const cell = (i, j) => {
    const task = i * payloads.length + j;
    return h("td", {}, percentCell(percent.get(task), good, about(task)));
  };
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: "grid-table heat" },
      h("caption", {}, caption),
      h(
        "tbody",
        {},
        payloads.map((payload, j) => h("tr", {}, h("th", { scope: "row" }, quantity(payload, "kg")), grid.stroke.map((_, i) => cell(i, j)))).reverse(),
      ),
      h("tfoot", {}, h("tr", {}, h("th", { scope: "row" }, "stroke [rad]"), grid.stroke.map((stroke) => h("th", { scope: "col" }, number(stroke))))),
    ),
  );
}

/** One percentage as a coloured cell. */
export function percentCell(percent, good, about) {
  const known = percent !== undefined && percent !== null;
  const share = known ? Math.min(1, Math.abs(percent) / FULL) : 0;
  const text = known ? signed(percent) : about.text;
  return h(
    "a",
    {
      class: "cell",
      href: about.href,
      dataset: known ? { sign: good * percent < 0 ? "worse" : "better", ...(share > STRONG ? { strong: "" } : {}) } : {},
      style: { "--share": String(share) },
      "aria-label": `${about.label}: ${known ? `${text} percent` : text}`,
    },
    known ? text : h("small", {}, text),
  );
}

/** Address of a task's page. */
export const taskLink = (id, task, method) => applicationLink(id, `/tasks/${task}`, { method });

/** What the colours mean. */
export function heatKey(worse, better) {
  return h(
    "p",
    { class: "scale-key" },
    h("span", {}, `${worse}, ${FULL} % and more`),
    h("span", { class: "ramp two", "aria-hidden": "true" }),
    h("span", {}, better),
  );
}
