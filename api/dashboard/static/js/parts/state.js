/** A state: a shape, a colour and a word, so that none of them has to be told by colour alone. */

import { h } from "../dom.js";
import { stateName } from "../format.js";

const SHAPES = {
  queued: "○",
  running: "◔",
  succeeded: "✓",
  completed_with_failures: "!",
  failed: "✕",
  dead: "✕",
  cancelled: "–",
};

export const shape = (state) => SHAPES[state] ?? "·";

/** @param {string} state @returns {HTMLElement} */
export function stateBadge(state) {
  return h(
    "span",
    { class: "state", dataset: { state } },
    h("span", { class: "shape", "aria-hidden": "true" }, shape(state)),
    stateName(state),
  );
}
