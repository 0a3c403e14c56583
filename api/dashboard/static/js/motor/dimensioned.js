/** A motor large, with its seven lengths drawn where they are. */

import { s } from "../dom.js";
import { fixed } from "../format.js";
import { drawnSymbol } from "../parts/symbol.js";
import { across, along } from "./drawing.js";

const TEXT = 3.4;
const BESIDE = 32; // mm beside the cross-section, for texts
const AROUND = 12; // mm around everything
const GAP = 5; // mm between the section along the axis and its lengths

/** @param {any} section @param {Record<string, number>} d the seven lengths [mm] @param {string} title */
export function dimensioned(section, d, title) {
  const R = section.statorRadius;
  const k = (4 * R + d.L + 3 * BESIDE) / 260; // larger drawings get larger texts
  const left = R + 2 * BESIDE * k; // where the section along the axis begins
  const box = [-R - BESIDE * k, -R - AROUND * k, left + d.L + R + 2 * BESIDE * k, 2 * R + 2 * AROUND * k];
  return s(
    "svg",
    { class: "drawing large", viewBox: box.map((v) => v.toFixed(2)).join(" "), role: "img", "aria-label": title },
    across(section),
    radius(d, section, k),
    inSlots(d, section, k),
    s("g", { transform: `translate(${left} 0) rotate(-90)` }, along(section)),
    span("L", d.L, [left, -R - GAP * k], [left + d.L, -R - GAP * k], [0, -1.5 * k], "middle", k),
    span("R_so", d.R_so, [left + d.L + GAP * k, 0], [left + d.L + GAP * k, -R], [2 * k, k], "start", k),
    span("R_ro", d.R_ro, [left + d.L + GAP * k, 0], [left + d.L + GAP * k, d.R_ro], [2 * k, k], "start", k),
  );
}

/** Two radii of the cross-section, drawn to the left. */
function radius(d, section, k) {
  const R = section.statorRadius;
  const yoke = pointer("h_sy", d.h_sy, [-R + d.h_sy / 2, 0], [-R - 4 * k, 0], "end", k);
  const bar = s("line", { class: "size", x1: -R, x2: -R + d.h_sy, y1: 0, y2: 0 });
  const magnet = [-(d.R_ro - d.h_m / 2) * Math.cos(0.9), (d.R_ro - d.h_m / 2) * Math.sin(0.9)];
  return s("g", {}, bar, yoke, pointer("h_m", d.h_m, magnet, [-R - 4 * k, R * 0.72], "end", k));
}

/** Tooth width at the tooth on the right, slot opening at the slot above it. */
function inSlots(d, section, k) {
  const R = section.statorRadius;
  const middle = (section.slotInner + section.slotOuter) / 2;
  const tooth = s("line", { class: "size", x1: middle, x2: middle, y1: -d.w_tooth / 2, y2: d.w_tooth / 2 });
  const angle = -section.pitch / 2;
  const at = (section.bore + section.slotInner) / 2;
  const opening = [at * Math.cos(angle), at * Math.sin(angle)];
  return s(
    "g",
    {},
    tooth,
    pointer("w_tooth", d.w_tooth, [middle, 0], [R + 4 * k, R * 0.3], "start", k),
    pointer("b_0", d.b_0, opening, [R + 4 * k, -R * 0.62], "start", k),
  );
}

/** A line with an arrow at each end, and its length beside its middle. */
function span(name, value, from, to, shift, anchor, k) {
  const middle = [(from[0] + to[0]) / 2 + shift[0], (from[1] + to[1]) / 2 + shift[1]];
  return s(
    "g",
    {},
    s("line", { class: "size", x1: from[0], y1: from[1], x2: to[0], y2: to[1] }),
    tip(from, to),
    tip(to, from),
    label(name, value, middle, anchor, k),
  );
}

/** A line from a detail to its length. */
function pointer(name, value, detail, text, anchor, k) {
  const gap = anchor === "end" ? -1 : 1;
  return s(
    "g",
    {},
    s("polyline", { class: "size", points: `${detail} ${text}` }),
    s("circle", { class: "tip", cx: detail[0], cy: detail[1], r: 0.5 }),
    label(name, value, [text[0] + gap, text[1] + TEXT / 3], anchor, k),
  );
}

function tip(at, other) {
  const angle = Math.atan2(other[1] - at[1], other[0] - at[0]);
  const side = (turn) => [at[0] + 2 * Math.cos(angle + turn), at[1] + 2 * Math.sin(angle + turn)];
  return s("polygon", { class: "tip", points: `${at} ${side(0.3)} ${side(-0.3)}` });
}

function label(name, value, [x, y], anchor, k) {
  return drawnSymbol(name, { x, y, "text-anchor": anchor, "font-size": TEXT * k }, ` ${fixed(value)} mm`);
}
