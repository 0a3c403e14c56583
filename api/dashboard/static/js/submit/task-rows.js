/** A list of tasks, a row each. */

import { h } from "../dom.js";
import { field } from "./field.js";
import { given, manyNumbers, oneNumber } from "./numbers.js";

const COLUMNS = [
  ["name", "Name", (text) => text.trim()],
  ["start_rad", "Start [rad]", manyNumbers],
  ["end_rad", "End [rad]", manyNumbers],
  ["payload_kg", "Payload [kg]", oneNumber],
  ["duration_s", "Duration [s]", oneNumber],
  ["weight", "Weight", oneNumber],
];

const FIRST = [
  { name: "pick", start_rad: "0.6, 0.6, 0.6, 0.6, 0.6, 0.6", end_rad: "0, 0, 0, 0, 0, 0", payload_kg: "2" },
  { name: "place", start_rad: "0.3, 0.3, 0.3, 0.3, 0.3, 0.3", end_rad: "0, 0, 0, 0, 0, 0" },
];

export function taskRows() {
  const body = h("div", { class: "form" });
  const rows = [];

  function add(values) {
    const row = { inputs: {}, element: h("div", { class: "task-row", role: "group" }) };
    for (const [name, label] of COLUMNS) {
      const wide = name.endsWith("_rad") || name === "name";
      const input = h("input", { type: "text", inputmode: wide ? null : "decimal", value: values[name] ?? "", autocomplete: "off" });
      row.inputs[name] = input;
      row.element.append(field("", label, input));
    }
    row.element.append(h("button", { type: "button", class: "quiet", "aria-label": "Remove this task", on: { click: () => drop(row) } }, "✕"));
    rows.push(row);
    body.append(row.element);
    rename();
  }

  function drop(row) {
    rows.splice(rows.indexOf(row), 1);
    row.element.remove();
    rename();
  }

  /** The server names tasks by their place. */
  function rename() {
    rows.forEach((row, k) => {
      row.element.setAttribute("aria-label", `Task ${k}`);
      for (const [name, input] of Object.entries(row.inputs)) input.dataset.field = `tasks[${k}].${name}`;
    });
  }

  FIRST.forEach(add);
  const another = () => {
    add({ end_rad: "0, 0, 0, 0, 0, 0" });
    rows.at(-1).inputs.name.focus();
  };
  const element = h(
    "div",
    { class: "form" },
    h("p", { class: "hint" }, "One angle a joint, joint 1 (base) first. Task 0 is the first."),
    body,
    h("div", {}, h("button", { type: "button", class: "quiet", on: { click: another } }, "Add a task")),
  );
  const value = () =>
    rows.map((row) => given(Object.fromEntries(COLUMNS.map(([name, , read]) => [name, read(row.inputs[name].value)]))));
  return { element, value };
}
