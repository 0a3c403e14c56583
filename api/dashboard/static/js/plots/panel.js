/** One quantity of one joint over time, with its limits and a line for now. */

import { s } from "../dom.js";
import { fixed, number } from "../format.js";
import { valueAt } from "./motion-rows.js";
import { linear, ticks } from "./scale.js";

const SMALL = { width: 190, height: 118, left: 34, right: 6, top: 20, bottom: 18 };
const LARGE = { width: 360, height: 190, left: 40, right: 8, top: 22, bottom: 22 };
const HEADROOM = 1.12;

/**
 * @param {import("./motion-rows.js").Row} row
 * @param {number} joint from 0
 * @param {number} end of the motion [s]
 * @param {{large: boolean, seek: (time: number) => void}} options
 */
export function panel(row, joint, end, { large, seek }) {
  const size = large ? LARGE : SMALL;
  const { width, height, left, right, top, bottom } = size;
  const [low, high] = [row.low[joint], row.high[joint]];
  const view = viewOf(row);
  const x = linear([0, end], [left, width - right]);
  const y = linear(view, [height - bottom, top]);
  const now = s("line", { class: "now", y1: top, y2: height - bottom });
  const readout = s("text", { class: "readout", x: width - right, y: 12, "text-anchor": "end" });
  const inView = (value) => value >= view[0] && value <= view[1];
  const decimals = Math.max(0, 2 - Math.floor(Math.log10(Math.max(...view.map(Math.abs)) || 1)));
  const element = s(
    "svg",
    { class: "plot", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": description(row, joint) },
    s("text", { class: "title", x: 0, y: 12 }, large ? `${row.label} [${row.unit}]` : `${row.label}`),
    beyond(low, high, view, x(0), x(end), y),
    ticks(...view, large ? 5 : 3).map((value) => [
      s("line", { class: "gridline", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
      s("text", { x: left - 4, y: y(value) + 4, "text-anchor": "end" }, number(value, 3)),
    ]),
    ticks(0, 1000 * end, large ? 4 : 2).map((ms, k, all) =>
      s(
        "text",
        { x: x(ms / 1000), y: height - 4, "text-anchor": ms / 1000 > 0.85 * end ? "end" : "middle" },
        k + 1 < all.length ? number(ms) : `${number(ms)} ms`,
      ),
    ),
    [low, high].map((value) => (inView(value) ? s("line", { class: "limit", x1: x(0), x2: x(end), y1: y(value), y2: y(value) }) : null)),
    row.curves.toReversed().map((curve) =>
      s("polyline", {
        class: `curve${curve.second ? " second" : ""}`,
        points: curve.points[joint].map(([t, v]) => `${x(t).toFixed(1)},${y(v).toFixed(1)}`).join(" "),
      }),
    ),
    now,
    readout,
  );
  const pointed = (event) => {
    if (event.buttons !== 1 && event.type === "pointermove") return;
    const box = element.getBoundingClientRect();
    seek((end * (((event.clientX - box.left) / box.width) * width - left)) / (width - left - right));
  };
  element.addEventListener("pointerdown", pointed);
  element.addEventListener("pointermove", pointed);
  return {
    element,
    at(time) {
      now.setAttribute("x1", x(time));
      now.setAttribute("x2", x(time));
      readout.textContent = row.curves
        .map((curve) => `${curve.name ? `${curve.name} ` : ""}${fixed(valueAt(curve.points[joint], time), decimals)}`)
        .join("  ");
    },
  };
}

/** All limits in view when the motion comes near any of them, else the motion alone: the same for all joints. */
function viewOf(row) {
  const values = row.curves.flatMap((curve) => curve.points.flatMap((points) => points.map(([, value]) => value)));
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const limit = Math.max(...[...row.low, ...row.high].filter(Number.isFinite).map(Math.abs));
  if (Math.max(Math.abs(low), Math.abs(high)) > 0.5 * limit) return [-HEADROOM * limit, HEADROOM * limit];
  const room = (HEADROOM - 1) * (high - low || 1);
  return [low - room, high + room];
}

function beyond(low, high, [bottom, top], x1, x2, y) {
  const area = (from, to) => s("rect", { class: "beyond", x: x1, width: x2 - x1, y: y(to), height: Math.max(0, y(from) - y(to)) });
  return [high < top ? area(high, top) : null, low > bottom ? area(bottom, low) : null];
}

function description(row, joint) {
  const values = row.curves[0].points[joint].map(([, value]) => value);
  const range = `${number(Math.min(...values))} to ${number(Math.max(...values))} ${row.unit}`;
  const limits = Number.isFinite(row.high[joint]) ? `, limits ${number(row.low[joint])} to ${number(row.high[joint])}` : "";
  return `${row.label} of joint ${joint + 1} over time: ${range}${limits}`;
}
