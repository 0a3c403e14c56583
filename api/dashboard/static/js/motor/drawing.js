/** A motor across and along its axis, to scale: lengths in mm are lengths in the drawing. */

import { s } from "../dom.js";

/** Stator, winding, magnets, rotor, around the origin. @param {ReturnType<import("./section.js").motorSection>} section */
export function across(section) {
  return s(
    "g",
    {},
    disc(section.statorRadius, "stator"),
    shapes(section.slots, ["copper"]),
    shapes(section.openings, ["air"]),
    disc(section.bore, "air"),
    shapes(section.magnets, ["north", "south"]),
    disc(section.magnetInner, "rotor"),
  );
}

/** Cut through two opposite teeth; the axis runs down. Hangs from the origin. */
export function along(section) {
  const length = section.stackLength;
  const bar = (left, right, kind) =>
    s("rect", { class: kind, x: left, y: 0, width: right - left, height: length });
  return s(
    "g",
    {},
    bar(-section.statorRadius, -section.bore, "stator"),
    bar(section.bore, section.statorRadius, "stator"),
    bar(-section.rotorRadius, -section.magnetInner, "south"),
    bar(section.magnetInner, section.rotorRadius, "north"),
    bar(-section.magnetInner, section.magnetInner, "rotor"),
    s("line", { class: "axis", x1: 0, x2: 0, y1: -3, y2: length + 3 }),
  );
}

const disc = (radius, kind) => s("circle", { class: kind, r: radius });

function shapes(outlines, kinds) {
  return outlines.map((outline, k) =>
    s("polygon", { class: kinds[k % kinds.length], points: outline.map(([x, y]) => `${x.toFixed(3)},${y.toFixed(3)}`).join(" ") }),
  );
}
