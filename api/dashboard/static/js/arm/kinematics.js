/**
 * Where the parts of an arm are, from its screw axes at home in the space frame (product of exponentials).
 * Poses are 3 x 4: rotation and translation.
 */

/** @typedef {[number, number, number]} Point  @typedef {number[][]} Pose */

/** @type {Pose} */
export const IDENTITY = [
  [1, 0, 0, 0],
  [0, 1, 0, 0],
  [0, 0, 1, 0],
];

/** Pose of a turn by an angle about a screw axis (omega, v) of unit length and no pitch. @returns {Pose} */
export function screw([wx, wy, wz, vx, vy, vz], angle) {
  const [c, sn] = [Math.cos(angle), Math.sin(angle)];
  const o = 1 - c;
  const rotation = [
    [c + o * wx * wx, o * wx * wy - sn * wz, o * wx * wz + sn * wy],
    [o * wy * wx + sn * wz, c + o * wy * wy, o * wy * wz - sn * wx],
    [o * wz * wx - sn * wy, o * wz * wy + sn * wx, c + o * wz * wz],
  ];
  const on = cross([wx, wy, wz], [vx, vy, vz]); // a point of the axis
  return rotation.map((row, k) => [...row, on[k] - dot(row, on)]);
}

/** @returns {Pose} */
export function compose(a, b) {
  return a.map((row) =>
    [0, 1, 2, 3].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k] + (k === 3 ? row[3] : 0)),
  );
}

/** @returns {Point} */
export const moved = (pose, p) => pose.map((row) => dot(row, p) + row[3]);

/** @returns {Point} */
export const turned = (pose, d) => pose.map((row) => dot(row, d));

/**
 * Motors and tool at some joint angles.
 *
 * @param {any} robot in the form that the interface gives
 * @param {number[]} angles rad
 * @returns {{motors: {at: Point, axis: Point}[], tool: Point}}
 */
export function armAt(robot, angles) {
  let pose = IDENTITY;
  const motors = robot.screw_axes_space.map((axis, k) => {
    const before = pose; // a motor sits on the link before its joint
    pose = compose(pose, screw(axis, angles[k]));
    return { at: moved(before, robot.motor_position_home_m[k]), axis: turned(before, axis.slice(0, 3)) };
  });
  const tool = robot.tool_home.slice(0, 3).map((row) => row[3]);
  return { motors, tool: moved(pose, tool) };
}

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @returns {Point} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const times = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const length = (a) => Math.sqrt(dot(a, a));
