/** Prisms with many sides: links and motors as faces that a painter can sort. */

import { cross, dot, length, minus, plus, times } from "./kinematics.js";

/** @typedef {{points: number[][], normal: number[], colour: string}} Face */

/** Between two points. @returns {Face[]} */
export function prism(from, to, radius, colour, capColour = colour, sides = 14) {
  const along = minus(to, from);
  const size = length(along);
  if (size < 1e-6) return [];
  const w = times(along, 1 / size);
  const helper = Math.abs(w[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const u = unit(cross(helper, w));
  const v = cross(w, u);
  const spoke = (k) => {
    const angle = (2 * Math.PI * k) / sides;
    return plus(times(u, Math.cos(angle)), times(v, Math.sin(angle)));
  };
  const ring = Array.from({ length: sides }, (_, k) => times(spoke(k), radius));
  const low = ring.map((r) => plus(from, r));
  const high = ring.map((r) => plus(to, r));
  const faces = ring.map((_, k) => {
    const next = (k + 1) % sides;
    return { points: [low[k], low[next], high[next], high[k]], normal: spoke(k + 0.5), colour };
  });
  faces.push({ points: [...low].reverse(), normal: times(w, -1), colour: capColour });
  faces.push({ points: high, normal: w, colour: capColour });
  return faces;
}

/** A cylinder around a point, its axis along a direction. @returns {Face[]} */
export function cylinder(at, axis, radius, size, colour, capColour) {
  const half = times(unit(axis), size / 2);
  return prism(minus(at, half), plus(at, half), radius, colour, capColour, 22);
}

const unit = (a) => times(a, 1 / (Math.sqrt(dot(a, a)) || 1));
