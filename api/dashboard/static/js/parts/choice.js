/** One of a few, side by side: radio buttons that look like a switch. */

import { h } from "../dom.js";

let groups = 0;

/**
 * @param {string} label
 * @param {[string, any][]} options value and what it says
 * @param {string} chosen
 * @param {(value: string) => void} react
 */
export function choice(label, options, chosen, react) {
  const name = `choice-${(groups += 1)}`;
  return h(
    "fieldset",
    { class: "choice" },
    h("legend", { class: "visually-hidden" }, label),
    options.map(([value, text]) =>
      h(
        "label",
        {},
        h("input", { type: "radio", name, value, checked: value === chosen, on: { change: () => react(value) } }),
        h("span", {}, text),
      ),
    ),
  );
}
