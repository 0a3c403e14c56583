/** The arm with its motors, to scale, on a canvas; turned by dragging or with the arrow keys. */

import { h } from "../dom.js";
import { camera, turnByHand } from "./camera.js";
import { armAt, dot, length, minus } from "./kinematics.js";
import { colours } from "./colours.js";
import { cylinder, prism } from "./solids.js";

const LIGHT = [0.35, -0.5, 0.79];
const LINK_RADIUS = 0.024; // m; the model gives links no shape
const BASE_RADIUS = 0.05;
const BALL_RADIUS = 0.05; // m, the payload of the model
const SMALLEST_ROOM = 0.2; // m, to either side: an arm without a length, as of one joint, would be nothing but its payload
const GRID = 0.1; // m

/**
 * @param {any} robot
 * @param {{R_so: number, L: number}[]} motors mm
 * @param {number[][]} positions rad, of the whole motion, for the path of the tool
 * @param {number} payload kg
 * @param {AbortSignal} signal
 */
export function armView(robot, motors, positions, payload, signal) {
  const canvas = h("canvas", {
    class: "arm",
    tabindex: "0",
    role: "img",
    "aria-label": "The arm in motion, motors to scale. Arrow keys turn it, plus and minus zoom.",
  });
  const path = positions.map((angles) => armAt(robot, angles).tool);
  const room = roomOf(robot, positions);
  const { view, look, fit } = camera(room.centre, room.radius);
  let angles = positions[0];
  let ink = colours(canvas);
  let fitted = false;

  function draw(next = angles) {
    angles = next;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (width === 0) return;
    if (!fitted) fit(room.points, width, height);
    fitted = true;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const seen = look(width, height);
    drawGround(pen, seen, room, ink);
    drawGhost(pen, seen, robot, positions[0], ink);
    drawGhost(pen, seen, robot, positions.at(-1), ink);
    drawPath(pen, seen, path, ink);
    drawArm(pen, seen, armAt(robot, angles), { motors, payload, floor: room.floor }, ink);
  }

  const resized = new ResizeObserver(() => draw());
  resized.observe(canvas);
  signal.addEventListener("abort", () => resized.disconnect());
  document.addEventListener(
    "themechange",
    () => {
      ink = colours(canvas);
      draw();
    },
    { signal },
  );
  turnByHand(canvas, view, () => draw(), signal);
  requestAnimationFrame(() => {
    ink = colours(canvas); // known once it is on the page
    draw();
  });
  return { canvas, draw };
}

/** What the motion needs: its middle and size, and a floor below everything. */
function roomOf(robot, positions) {
  const points = positions.flatMap((angles) => pointsOf(armAt(robot, angles)));
  points.push([points[0][0], points[0][1], 0]);
  const ends = [0, 1, 2].map((k) => [Math.min(...points.map((p) => p[k])), Math.max(...points.map((p) => p[k]))]);
  const floor = ends[2][0] < -1e-6 ? Math.floor((ends[2][0] - BALL_RADIUS) / GRID) * GRID : 0;
  ends[2][0] = floor;
  const centre = ends.map(([low, high]) => (low + high) / 2);
  const around = [0, 1, 2].flatMap((k) => [-1, 1].map((sign) => centre.map((x, i) => x + (i === k ? sign * SMALLEST_ROOM : 0))));
  return {
    centre,
    radius: Math.max(SMALLEST_ROOM, length(ends.map(([low, high]) => (high - low) / 2)) + BALL_RADIUS),
    floor,
    points: [...points, ...around, [points[0][0], points[0][1], floor]],
  };
}

/** From joint to joint, to the tool. */
const pointsOf = (arm) => [...arm.motors.map((motor) => motor.at), arm.tool];

function drawArm(pen, seen, arm, { motors, payload, floor }, ink) {
  const points = pointsOf(arm);
  const faces = prism([points[0][0], points[0][1], floor], points[0], BASE_RADIUS, ink.link);
  for (let k = 1; k < points.length; k += 1) faces.push(...prism(points[k - 1], points[k], LINK_RADIUS, ink.link));
  arm.motors.forEach(({ at, axis }, k) => {
    faces.push(...cylinder(at, axis, motors[k].R_so / 1000, motors[k].L / 1000, ink.motor, ink.cap));
  });
  const things = faces
    .filter((face) => seen.faces(face.normal, face.points[0]))
    .map((face) => {
      const flat = face.points.map(seen.project);
      return { depth: flat.reduce((sum, p) => sum + p[2], 0) / flat.length, paint: () => paintFace(pen, face, flat) };
    });
  if (payload > 0) things.push(ball(pen, seen, arm.tool, ink));
  things.sort((a, b) => a.depth - b.depth);
  for (const thing of things) thing.paint();
}

function paintFace(pen, face, flat) {
  const light = 0.62 + 0.38 * Math.max(0, dot(face.normal, LIGHT));
  const shade = `rgb(${face.colour.map((channel) => Math.round(channel * light)).join(" ")})`;
  pen.beginPath();
  flat.forEach(([x, y], k) => (k === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y)));
  pen.closePath();
  pen.fillStyle = shade;
  pen.strokeStyle = shade; // closes the hair lines between faces
  pen.lineWidth = 0.7;
  pen.fill();
  pen.stroke();
}

function ball(pen, seen, at, ink) {
  const [x, y, depth] = seen.project(at);
  const radius = seen.pixels(BALL_RADIUS);
  const paint = () => {
    const glow = pen.createRadialGradient(x - radius / 3, y - radius / 3, radius / 8, x, y, radius);
    glow.addColorStop(0, `rgb(${ink.ball.map((channel) => Math.min(255, channel + 50)).join(" ")})`);
    glow.addColorStop(1, `rgb(${ink.ball.join(" ")})`);
    pen.fillStyle = glow;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  };
  return { depth: depth + BALL_RADIUS, paint };
}

function drawGround(pen, seen, { centre, radius, floor }, ink) {
  const half = Math.ceil((1.2 * radius) / GRID) * GRID;
  const [x, y] = centre.map((value) => Math.round(value / GRID) * GRID);
  pen.strokeStyle = `rgb(${ink.line.join(" ")})`;
  pen.lineWidth = 0.8;
  pen.beginPath();
  for (let at = -half; at <= half + 1e-9; at += GRID) {
    segment(pen, seen.project([x + at, y - half, floor]), seen.project([x + at, y + half, floor]));
    segment(pen, seen.project([x - half, y + at, floor]), seen.project([x + half, y + at, floor]));
  }
  pen.stroke();
}

/** Where the motion begins or ends, as a thin line. */
function drawGhost(pen, seen, robot, angles, ink) {
  polyline(pen, pointsOf(armAt(robot, angles)).map(seen.project), ink.quiet, [3, 3]);
}

function drawPath(pen, seen, path, ink) {
  polyline(pen, path.map(seen.project), ink.path, []);
}

function polyline(pen, points, colour, dashes) {
  pen.strokeStyle = `rgb(${colour.join(" ")})`;
  pen.lineWidth = 1.4;
  pen.setLineDash(dashes);
  pen.beginPath();
  points.forEach(([x, y], k) => (k === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y)));
  pen.stroke();
  pen.setLineDash([]);
}

function segment(pen, a, b) {
  pen.moveTo(a[0], a[1]);
  pen.lineTo(b[0], b[1]);
}
