/** What a design was judged by, iteration by iteration of the program that looked for it. */

import { s } from "../dom.js";
import { number, quantity, unit } from "../format.js";
import { linear, ticks } from "./scale.js";

const SIZE = { width: 720, height: 230, left: 56, right: 12, top: 26, bottom: 36 };
const HEADROOM = 0.08;
const SETTLED = 0.2;

/** @param {[number, number][]} points iteration and value @param {string} wire unit of the value */
export function convergencePlot(points, wire) {
  const { width, height, left, right, top, bottom } = SIZE;
  const [first, last] = [points[0], points.at(-1)];
  const view = viewOf(points);
  const x = linear([first[0], last[0]], [left, width - right]);
  const y = linear(view, [height - bottom, top]);
  const inView = (value) => Math.min(view[1], Math.max(view[0], value));
  const label = `From ${quantity(first[1], wire)} at iteration ${first[0]} to ${quantity(last[1], wire)} at iteration ${last[0]}`;
  return s(
    "svg",
    { class: "plot convergence", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label },
    s("text", { class: "title", x: 0, y: 12 }, `objective${unit(wire) ? ` [${unit(wire)}]` : ""}`),
    ticks(...view, 4).map((value) => [
      s("line", { class: "gridline", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
      s("text", { x: left - 5, y: y(value) + 4, "text-anchor": "end" }, number(value, 4)),
    ]),
    ticks(first[0], last[0], 6)
      .filter(Number.isInteger)
      .map((iteration) => s("text", { x: x(iteration), y: height - bottom + 15, "text-anchor": "middle" }, String(iteration))),
    s("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, "iteration"),
    s("line", { class: "bound", x1: left, x2: width - right, y1: y(last[1]), y2: y(last[1]) }),
    s("polyline", { class: "curve", points: points.map(([k, value]) => `${x(k).toFixed(1)},${y(inView(value)).toFixed(1)}`).join(" ") }),
  );
}

/** Without the first steps, which may be anywhere: the program may be entered from outside its limits. */
function viewOf(points) {
  const settled = points.slice(Math.floor(SETTLED * (points.length - 1))).map(([, value]) => value);
  const [low, high] = [Math.min(...settled), Math.max(...settled)];
  const room = HEADROOM * (high - low || Math.abs(high) || 1);
  return [low - room, high + room];
}
