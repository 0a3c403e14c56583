/** A task as a cell: its value and a colour, or why there is none. Changed in place. */

import { h, replace } from "../dom.js";
import { fixed, methodName, quantity, stateName } from "../format.js";
import { applicationLink } from "../router.js";
import { shape } from "./state.js";

/** Share of the range from which on a cell is so strongly coloured that its text changes colour. */
const MUCH = 0.735;

/** @param {string} id of the application @param {any} task of the overview */
export function taskCell(id, task) {
  const element = h("a", { class: "cell" });
  let shown = "";

  /** @param {any} outcome @param {string} method @param {{low: number, high: number, unit: string}} scale */
  function update(outcome, method, scale, iteration) {
    const state = outcome?.state ?? "queued";
    const value = outcome?.value ?? null;
    const share = value === null || scale.high <= scale.low ? 0 : (value - scale.low) / (scale.high - scale.low);
    const key = [state, value, share, method, iteration].join();
    if (key === shown) return;
    shown = key;
    element.href = applicationLink(id, `/tasks/${task.index}`, { method });
    element.dataset.state = state;
    if (value === null) delete element.dataset.value;
    else element.dataset.value = share > MUCH ? "much" : "little";
    element.style.setProperty("--share", String(share));
    const said = value === null ? stateName(state) : quantity(value, scale.unit);
    element.setAttribute("aria-label", `${task.name}: ${said}, ${methodName(method)}`);
    element.title = outcome?.reason ? `${task.name}: ${outcome.reason}` : `${task.name}: ${said}`;
    if (value !== null) replace(element, fixed(value, scale.decimals));
    else replace(element, shape(state), h("small", {}, iteration ? `step ${iteration}` : stateName(state)));
  }

  return { element, update };
}
