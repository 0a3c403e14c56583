/** How hard a motion works each motor: its largest share of each limit. */

import { h } from "../dom.js";
import { words } from "../format.js";

/** @param {Record<string, number[]>} peaks shares by limit, one a joint */
export function useOfLimits(peaks) {
  const names = Object.keys(peaks);
  const joints = peaks[names[0]]?.length ?? 0;
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight narrow" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Joint"), Array.from({ length: joints }, (_, k) => h("th", { scope: "col", class: "figure" }, String(k + 1))))),
      h(
        "tbody",
        {},
        names.map((name) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, words(name)),
            peaks[name].map((share) => h("td", { class: `figure${share > 0.999 ? " binds" : ""}` }, `${Math.round(100 * share)}`)),
          ),
        ),
      ),
    ),
  );
}
