/** Play, pause and scrub a motion. */

import { h } from "../dom.js";
import { fixed, THIN } from "../format.js";
import { choice } from "../parts/choice.js";

const SLOWNESS = [
  ["1", "real time"],
  ["4", "¼"],
  ["10", "⅒"],
];
const REST_S = 0.6; // between two rounds

/** @param {number} end of the motion [s] @param {(time: number) => void} show @param {AbortSignal} signal */
export function player(end, show, signal) {
  let time = 0;
  let slowness = 10;
  let playing = false;
  let rest = 0;
  const slider = h("input", { type: "range", min: 0, max: end, step: end / 1000, value: 0, "aria-label": "Time in the motion" });
  const output = h("output", {});
  const button = h("button", { type: "button", on: { click: () => (playing ? pause() : play()) } }, "▶ Play");

  function seek(next) {
    time = Math.max(0, Math.min(end, next));
    slider.value = String(time);
    slider.setAttribute("aria-valuetext", `${fixed(time, 3)} seconds`);
    output.textContent = `${fixed(time, 3)} of ${fixed(end, 3)}${THIN}s`;
    show(time);
  }

  function play() {
    playing = true;
    button.textContent = "❚❚ Pause";
    if (time >= end) seek(0);
    let before = performance.now();
    const step = (now) => {
      if (!playing || signal.aborted) return;
      const passed = Math.min(0.1, (now - before) / 1000);
      before = now;
      if (time < end) seek(time + passed / slowness);
      else if ((rest += passed) > REST_S) {
        rest = 0;
        seek(0);
      }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  function pause() {
    playing = false;
    button.textContent = "▶ Play";
  }

  slider.addEventListener("input", () => {
    pause();
    seek(Number(slider.value));
  });
  const element = h(
    "div",
    { class: "player" },
    button,
    slider,
    output,
    choice("Speed", SLOWNESS, "10", (value) => (slowness = Number(value))),
  );
  return { element, seek: (next) => (pause(), seek(next)), start: () => seek(0) };
}
