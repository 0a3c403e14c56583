/** Symbols of a motor's lengths, with their indices set low. */

import { h, s } from "../dom.js";
import { symbolParts } from "../names.js";

/** For text. @param {string} name */
export function symbol(name) {
  const [letter, index] = symbolParts(name);
  return h("span", { class: "symbol" }, h("i", {}, letter), index ? h("sub", {}, index) : null);
}

/** For a drawing. @param {string} name @param {object} props of the text @param {string} [more] after it */
export function drawnSymbol(name, props, more = "") {
  const [letter, index] = symbolParts(name);
  return s(
    "text",
    { class: "drawn-symbol", ...props },
    s("tspan", { "font-style": "italic" }, letter),
    index ? s("tspan", { "font-size": "70%", "baseline-shift": "sub" }, index) : null,
    more ? s("tspan", {}, more) : null,
  );
}
