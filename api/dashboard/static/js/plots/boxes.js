/** Boxes span the quartiles, the line is the median, whiskers reach the last value within 1.5 boxes, dots lie beyond. */

import { s } from "../dom.js";
import { number } from "../format.js";
import { drawMark } from "./marks.js";
import { linear, ticks } from "./scale.js";

const SIZE = { width: 330, height: 210, left: 42, right: 8, top: 10, bottom: 30 };
const WIDTH = 0.5;

/** @param {number[]} values */
export function quartiles(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const at = (share) => {
    const place = share * (sorted.length - 1);
    const below = Math.floor(place);
    const above = Math.min(below + 1, sorted.length - 1);
    return sorted[below] + (place - below) * (sorted[above] - sorted[below]);
  };
  const [low, median, high] = [at(0.25), at(0.5), at(0.75)];
  const reach = 1.5 * (high - low);
  const inside = sorted.filter((value) => value >= low - reach && value <= high + reach);
  return {
    low,
    median,
    high,
    whiskers: [inside[0], inside.at(-1)],
    beyond: sorted.filter((value) => value < inside[0] || value > inside.at(-1)),
  };
}

/**
 * @param {number[][]} columns values, one list a motor
 * @param {{kind: string, shift: number, values: number[]}[]} marks
 * @param {[number, number]} bounds
 * @param {string} label
 */
export function boxPlot(columns, marks, bounds, label) {
  const { width, height, left, right, top, bottom } = SIZE;
  const view = viewOf([...columns.flat(), ...marks.flatMap((mark) => mark.values)], bounds);
  const y = linear(view, [height - bottom, top]);
  const x = linear([0.4, columns.length + 0.6], [left, width - right]);
  const unit = x(1) - x(0);
  return s(
    "svg",
    { class: "plot", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label },
    beyondBounds(bounds, view, x(0.4), x(columns.length + 0.6), y),
    ticks(...view, 5).map((value) => [
      s("line", { class: "gridline", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
      s("text", { x: left - 6, y: y(value) + 4, "text-anchor": "end" }, number(value)),
    ]),
    columns.map((values, k) => [
      s("text", { x: x(k + 1), y: height - bottom + 15, "text-anchor": "middle" }, String(k + 1)),
      values.length ? box(quartiles(values), x(k + 1), unit, y) : null,
    ]),
    s("text", { x: (left + width - right) / 2, y: height - 2, "text-anchor": "middle" }, "motor of joint"),
    marks.map((mark) => mark.values.map((value, k) => drawMark(mark.kind, x(k + 1 + mark.shift), y(value), unit * WIDTH))),
  );
}

/** What is seen: the values with some room, and a bound where it is near. */
function viewOf(values, [lower, upper]) {
  const low = Math.min(...values);
  const high = Math.max(...values);
  const room = Math.max(0.08 * (high - low), 0.02 * high);
  return [Math.max(low - room, lower - 2 * room), Math.min(high + room, upper + 2 * room)];
}

function beyondBounds([lower, upper], [bottom, top], x1, x2, y) {
  const area = (from, to) => s("rect", { class: "beyond", x: x1, width: x2 - x1, y: y(to), height: y(from) - y(to) });
  const edge = (at) => s("line", { class: "bound", x1, x2, y1: y(at), y2: y(at) });
  return [
    lower > bottom ? [area(bottom, lower), edge(lower)] : null,
    upper < top ? [area(upper, top), edge(upper)] : null,
  ];
}

function box(q, x, unit, y) {
  const half = (unit * WIDTH) / 2;
  const line = (kind, x1, x2, y1, y2) => s("line", { class: kind, x1, x2, y1, y2 });
  const [least, most] = q.whiskers.map(y);
  return [
    line("whisker", x, x, y(q.low), least),
    line("whisker", x, x, y(q.high), most),
    line("whisker", x - half / 2, x + half / 2, least, least),
    line("whisker", x - half / 2, x + half / 2, most, most),
    s("rect", { class: "box", x: x - half, width: 2 * half, y: y(q.high), height: Math.max(0.5, y(q.low) - y(q.high)) }),
    line("median", x - half, x + half, y(q.median), y(q.median)),
    q.beyond.map((value) => s("circle", { class: "outlier", cx: x, cy: y(value), r: 2 })),
  ];
}
