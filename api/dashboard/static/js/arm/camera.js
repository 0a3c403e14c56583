/** From space (m, z up) to the canvas, with mild perspective; and how a person turns it. */

import { dot } from "./kinematics.js";

const DISTANCE = 6; // in units of what is seen
const TURN = 0.09; // rad a key press
const FILLED = 0.82; // share of the canvas

/** @param {number[]} centre @param {number} radius of what has to be seen [m] */
export function camera(centre, radius) {
  const view = { azimuth: -0.9, elevation: 0.32, zoom: 1 };

  /** @returns {{project: (p: number[]) => [number, number, number], faces: (n: number[], p: number[]) => boolean}} */
  function look(width, height) {
    const [ca, sa] = [Math.cos(view.azimuth), Math.sin(view.azimuth)];
    const [ce, se] = [Math.cos(view.elevation), Math.sin(view.elevation)];
    const right = [-sa, ca, 0];
    const towards = [ce * ca, ce * sa, se];
    const up = [-se * ca, -se * sa, ce];
    const scale = (0.5 * Math.min(width, 1.15 * height) * view.zoom) / radius;
    const eye = towards.map((x, k) => centre[k] + x * DISTANCE * radius);
    return {
      towards,
      project(p) {
        const d = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
        const depth = dot(d, towards);
        const near = (scale * DISTANCE * radius) / (DISTANCE * radius - depth);
        return [width / 2 + near * dot(d, right), height / 2 - near * dot(d, up), depth];
      },
      faces: (normal, p) => dot(normal, [eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]]) > 0,
      pixels: (metres) => scale * metres,
    };
  }

  /** Zoom so that points just fit. @param {number[][]} points */
  function fit(points, width, height) {
    view.zoom = 1;
    const { project } = look(width, height);
    const flat = points.map(project);
    const share = Math.max(...flat.map(([x, y]) => Math.max(Math.abs(2 * x - width) / width, Math.abs(2 * y - height) / height)));
    view.zoom = Math.min(3, FILLED / (share || 1));
  }

  return { view, look, fit };
}

/** Drag, arrow keys, plus and minus. @param {HTMLCanvasElement} canvas */
export function turnByHand(canvas, view, redraw, signal) {
  const turn = (dx, dy) => {
    view.azimuth -= dx;
    view.elevation = Math.max(-0.2, Math.min(1.5, view.elevation + dy));
    redraw();
  };
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId), { signal });
  canvas.addEventListener(
    "pointermove",
    (event) => {
      if (event.buttons === 1) turn(0.008 * event.movementX, 0.008 * event.movementY);
    },
    { signal },
  );
  const keys = {
    ArrowLeft: () => turn(TURN, 0),
    ArrowRight: () => turn(-TURN, 0),
    ArrowUp: () => turn(0, TURN),
    ArrowDown: () => turn(0, -TURN),
    "+": () => zoom(1.1),
    "-": () => zoom(1 / 1.1),
  };
  const zoom = (factor) => {
    view.zoom = Math.max(0.5, Math.min(4, view.zoom * factor));
    redraw();
  };
  canvas.addEventListener(
    "keydown",
    (event) => {
      if (!(event.key in keys)) return;
      event.preventDefault();
      keys[event.key]();
    },
    { signal },
  );
}
