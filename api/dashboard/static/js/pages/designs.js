/** Every task's own design, and how the designs for all tasks lie among them. */

import { get, ofApplication } from "../api.js";
import { h, replace } from "../dom.js";
import { count, fixed, number } from "../format.js";
import { DIMENSION_NAMES } from "../names.js";
import { OBJECTIVE_UNITS } from "../names.js";
import { head } from "../parts/head.js";
import { jointSolve } from "../parts/joint-solve.js";
import { symbol } from "../parts/symbol.js";
import { whenChanged } from "../parts/when-changed.js";
import { boxPlot } from "../plots/boxes.js";
import { markKey, marksOf } from "../plots/marks.js";

export async function show(at, signal) {
  const { id } = at.params;
  const [status, designs, resolved] = await Promise.all(
    ["", "/designs", "/resolved"].map((rest) => get(ofApplication(id, rest), signal)),
  );
  const top = head(status, "/designs");
  const body = h("div", { class: "page" }, content(status, designs, resolved));
  whenChanged(status, signal, async (next) => {
    top.setState(next.state);
    replace(body, content(next, await get(ofApplication(id, "/designs"), signal), resolved));
  });
  const element = h("div", { class: "page" }, top.element, body);
  return { title: `Designs of ${status.name}`, element };
}

function content(status, designs, resolved) {
  if (designs.tasks.length === 0) return h("p", { class: "empty" }, "No task has a design yet.");
  const marks = marksOf(designs, status.method);
  const panels = designs.dimensions.map((name, k) => panel(name, k, designs, marks, resolved.motor.bounds_mm[name]));
  const boxes = `own designs of ${count(designs.tasks.length, "task")}`;
  return [
    h("section", { class: "card" }, h("h2", {}, "How the tasks' own designs spread"), markKey(marks, boxes), h("div", { class: "panels" }, panels)),
    jointSolve(designs.methods.shared_optimum, status, OBJECTIVE_UNITS[status.objective.kind]),
    marks.length ? h("section", { class: "card" }, h("h2", {}, "Designs for all tasks [mm]"), sharedTable(designs, marks)) : null,
  ];
}

function panel(name, index, designs, marks, bounds) {
  const joints = designs.tasks[0].design_mm.length;
  const columns = Array.from({ length: joints }, (_, joint) => designs.tasks.map((task) => task.design_mm[joint][index]));
  const placed = marks.map((mark) => ({ ...mark, values: mark.design.map((row) => row[index]) }));
  const label = `${DIMENSION_NAMES[name] ?? name}: own designs of the tasks, one box a motor`;
  return h(
    "figure",
    { class: "panel" },
    h(
      "figcaption",
      {},
      symbol(name),
      ` ${DIMENSION_NAMES[name] ?? ""} [mm]`,
      h("span", { class: "hint" }, ` bounds ${number(bounds[0])} … ${number(bounds[1])}`),
    ),
    boxPlot(columns, placed, bounds, label),
  );
}

function sharedTable(designs, marks) {
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h(
        "thead",
        {},
        h("tr", {}, h("th", { scope: "col" }, "Motor"), h("th", { scope: "col" }, "Design"), designs.dimensions.map((d) => h("th", { scope: "col", class: "figure" }, symbol(d)))),
      ),
      h(
        "tbody",
        {},
        marks[0].design.map((_, joint) =>
          marks.map((mark, k) =>
            h(
              "tr",
              { class: k === 0 ? "first" : null },
              k === 0 ? h("th", { scope: "rowgroup", rowspan: marks.length }, String(joint + 1)) : null,
              h("td", {}, mark.label),
              mark.design[joint].map((value) => h("td", { class: "figure" }, fixed(value, 2))),
            ),
          ),
        ),
      ),
    ),
  );
}
