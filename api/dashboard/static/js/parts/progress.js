/** Progress bars that say their numbers. */

import { h } from "../dom.js";

/** @param {string} label @returns {{element: HTMLElement, update: (done: number, total: number, bad?: number) => void}} */
export function progressBar(label) {
  const good = h("span", { class: "bar-good" });
  const bad = h("span", { class: "bar-bad" });
  const element = h("div", { class: "bar", role: "progressbar", "aria-label": label, "aria-valuemin": 0 }, good, bad);
  return {
    element,
    update(done, total, failed = 0) {
      const share = (n) => `${total > 0 ? (100 * n) / total : 0}%`;
      good.style.width = share(done - failed);
      bad.style.width = share(failed);
      element.setAttribute("aria-valuemax", String(total));
      element.setAttribute("aria-valuenow", String(done));
      element.setAttribute("aria-valuetext", `${done} of ${total}${failed ? `, ${failed} failed` : ""}`);
    },
  };
}
