/** YAML or JSON as text; errors lead to their lines. */

import { h, replace } from "../dom.js";
import { lineOf } from "./yaml.js";

const EXAMPLE = `# Every quantity carries its unit in its name.
name: two moves
robot: ur5
objective: {kind: time}
tasks:
  - name: pick
    start_rad: [0.6, 0.6, 0.6, 0.6, 0.6, 0.6]
    end_rad: [0, 0, 0, 0, 0, 0]
    payload_kg: 2
  - name: place
    start_rad: [0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
    end_rad: [0, 0, 0, 0, 0, 0]
method: two_step
tags: [demo]
`;

export function editor() {
  const area = h("textarea", { class: "editor", spellcheck: "false", "aria-label": "Application as YAML or JSON", value: EXAMPLE });
  const list = h("ul", { class: "reasons" });
  area.value = EXAMPLE;

  /** @param {{field: string, message: string}[]} errors @param {string} detail */
  function show(errors, detail) {
    const found = errors.map((error) => ({ text: error.message, line: lineOf(area.value, error.field) }));
    const line = /line (\d+)/.exec(detail);
    if (errors.length === 0) found.push({ text: detail, line: line ? Number(line[1]) - 1 : -1 });
    area.setAttribute("aria-invalid", "true");
    replace(list, found.map((error) => h("li", {}, error.line >= 0 ? goTo(error) : error.text)));
    if (found[0].line >= 0) select(found[0].line);
  }

  const goTo = ({ text, line }) =>
    h("button", { type: "button", class: "quiet line", on: { click: () => select(line) } }, h("strong", {}, `line ${line + 1}: `), text);

  function select(line) {
    const rows = area.value.split("\n");
    const start = rows.slice(0, line).reduce((sum, row) => sum + row.length + 1, 0);
    area.focus();
    area.setSelectionRange(start, start + rows[line].length);
    const height = area.scrollHeight / rows.length;
    area.scrollTop = Math.max(0, (line - 4) * height);
  }

  function clear() {
    area.removeAttribute("aria-invalid");
    replace(list);
  }

  const element = h("section", { class: "card" }, h("h2", {}, "As YAML or JSON"), list, area);
  return { element, show, clear, value: () => area.value, fill: (text) => (area.value = text) };
}
