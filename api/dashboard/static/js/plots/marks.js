/** Designs over the boxes: each with its own form and colour. */

import { h, s } from "../dom.js";
import { methodName } from "../format.js";

/** @typedef {{label: string, kind: string, design: number[][], shift: number}} Mark */

/** Each design once: a chosen one that is also the worst case's is drawn as the chosen one. @returns {Mark[]} */
export function marksOf(designs, method) {
  const others = Object.entries(designs.methods).filter(([name]) => name !== method);
  const step = others.length > 1 ? 0.34 / (others.length - 1) : 0;
  const marks = others.map(([name, shared], k) => ({
    label: methodName(name),
    kind: { empirical: "empirical", worst_case: "worst" }[name] ?? "other",
    design: shared.design_mm,
    shift: others.length > 1 ? -0.17 + k * step : 0.17,
  }));
  if (designs.mean) marks.unshift({ label: "mean", kind: "mean", design: designs.mean.design_mm, shift: 0 });
  const chosen = designs.methods[method];
  if (chosen) marks.push({ label: `chosen: ${methodName(method)}`, kind: "chosen", design: chosen.design_mm, shift: 0 });
  return marks;
}

/** A mark around a point. */
export function drawMark(kind, x, y, width = 22) {
  const r = 4.2;
  const place = { class: `mark ${kind}` };
  if (kind === "mean") return s("line", { ...place, x1: x - width / 2, x2: x + width / 2, y1: y, y2: y });
  if (kind === "worst") return s("circle", { ...place, cx: x, cy: y, r });
  const corners = {
    empirical: [[0, -r], [r, r * 0.8], [-r, r * 0.8]],
    chosen: [[0, -r * 1.3], [r * 1.3, 0], [0, r * 1.3], [-r * 1.3, 0]],
    other: [[-r, -r], [r, -r], [r, r], [-r, r]],
  }[kind];
  return s("polygon", { ...place, points: corners.map(([dx, dy]) => `${x + dx},${y + dy}`).join(" ") });
}

/** What the marks mean. @param {Mark[]} marks @param {string} boxes */
export function markKey(marks, boxes) {
  const entry = (sign, text) => h("li", {}, s("svg", { viewBox: "-11 -7 22 14", class: "plot-sign", "aria-hidden": "true" }, sign), text);
  return h(
    "ul",
    { class: "key plot-key" },
    entry(s("rect", { class: "box", x: -8, y: -5, width: 16, height: 10 }), boxes),
    marks.map((mark) => entry(drawMark(mark.kind, 0, 0, 18), mark.label)),
    entry(s("line", { class: "bound", x1: -10, x2: 10, y1: 0, y2: 0 }), "bound"),
  );
}
