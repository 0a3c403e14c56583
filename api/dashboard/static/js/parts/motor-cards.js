/** All motors of a design at one scale, small; picking one shows it large elsewhere. */

import { h, s } from "../dom.js";
import { fixed } from "../format.js";
import { across, along } from "../motor/drawing.js";

const ROOM = 2; // mm around
const BETWEEN = 6; // mm between the two views

/** @param {any[]} sections @param {any[]} motors sheets of the design @param {number} chosen @param {(k: number) => void} react */
export function motorCards(sections, motors, chosen, react) {
  const widest = Math.max(...sections.map((section) => section.statorRadius));
  const longest = Math.max(...sections.map((section) => section.stackLength));
  const size = [2 * (widest + ROOM), 2 * widest + longest + BETWEEN + 3 * ROOM];
  const buttons = sections.map((section, k) =>
    h(
      "button",
      { type: "button", class: "motor-pick", "aria-pressed": String(k === chosen), on: { click: () => pick(k) } },
      h("span", {}, `Motor ${motors[k].joint}`),
      s(
        "svg",
        { class: "drawing", viewBox: `${-widest - ROOM} ${-widest - ROOM} ${size.join(" ")}`, "aria-hidden": "true" },
        across(section),
        s("g", { transform: `translate(0 ${widest + BETWEEN})` }, along(section)),
      ),
      h("small", {}, `⌀ ${fixed(2 * section.statorRadius, 1)} × ${fixed(section.stackLength, 1)} mm`),
    ),
  );

  function pick(k) {
    buttons.forEach((button, j) => button.setAttribute("aria-pressed", String(j === k)));
    react(k);
  }

  return h("div", { class: "motors", role: "group", "aria-label": "Motors, all to one scale" }, buttons);
}
