/** A motion's quantities with their limits, joint by joint. */

const PIECES = 8;

/**
 * @typedef {{label: string, unit: string, low: number[], high: number[],
 *            curves: {name: string, second: boolean, points: [number, number][][]}[]}} Row
 * `points` and limits are lists over the joints; a limit that is not known is NaN.
 */

/** @param {any} motion trajectory @param {any} result of the same motion @param {any} resolved @returns {Row[]} */
export function motionRows(motion, result, resolved) {
  const { robot, motor } = resolved;
  const joints = motion.joint_position_rad[0].length;
  const all = (value) => Array(joints).fill(value);
  const speed = (motion.gear_ratio ?? robot.gear_ratio).map((gear) => robot.rotor_speed_limit_rad_s / Math.abs(gear));
  const torque = torqueLimits(motion, result);
  const both = (d, q) => [
    { name: "q", second: false, points: q },
    { name: "d", second: true, points: d },
  ];
  const one = (points) => [{ name: "", second: false, points }];
  const sampled = (name) => byJoint(motion.time_s, motion[name]);
  const negative = (values) => values.map((value) => -value);
  const within = (label, unit, high, curves) => ({ label, unit, low: negative(high), high, curves });
  const ranges = robot.joint_position_limit_rad;
  return [
    {
      label: "position",
      unit: "rad",
      low: ranges.map((range) => range[0]),
      high: ranges.map((range) => range[1]),
      curves: one(sampled("joint_position_rad")),
    },
    within("joint speed", "rad/s", speed, one(sampled("joint_speed_rad_s"))),
    within("joint torque", "N m", torque, one(sampled("joint_torque_Nm"))),
    within("current", "A", all(motor.current_limit_A), both(sampled("current_d_A"), sampled("current_q_A"))),
    within("voltage", "V", all(motor.voltage_limit_V), both(voltage(motion, "voltage_d_V"), voltage(motion, "voltage_q_V"))),
  ];
}

/** Largest torque through its share of the limit; a joint that stands still tells nothing. */
function torqueLimits(motion, result) {
  const shares = (result?.peaks_at_points ?? result?.peaks)?.joint_torque ?? [];
  return motion.joint_torque_Nm[0].map((_, joint) => {
    const largest = Math.max(...motion.joint_torque_Nm.map((row) => Math.abs(row[joint])));
    return shares[joint] > 0 ? largest / shares[joint] : Number.NaN;
  });
}

/** @returns {[number, number][][]} */
function byJoint(time, rows) {
  return rows[0].map((_, joint) => time.map((t, k) => [t, rows[k][joint]]));
}

/** By the law that was replayed, where there is one: a polynomial on each interval. */
function voltage(motion, name) {
  const law = motion.control;
  if (!law?.breaks_s || !law[name]) return byJoint(motion.time_s, motion[name]);
  const joints = motion[name][0].length;
  return Array.from({ length: joints }, (_, joint) =>
    law[name].flatMap((coefficients, w) => {
      const [from, to] = [law.breaks_s[w], law.breaks_s[w + 1]];
      const pieces = coefficients.length > 1 ? PIECES : 1;
      return Array.from({ length: pieces + 1 }, (_, k) => {
        const share = k / pieces;
        const value = coefficients.reduceRight((sum, row) => sum * share + row[joint], 0);
        return [from + share * (to - from), value];
      });
    }),
  );
}

/** Value of a curve at a time. @param {[number, number][]} points */
export function valueAt(points, time) {
  let low = 0;
  let high = points.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (points[middle][0] <= time) low = middle;
    else high = middle;
  }
  const [[t0, v0], [t1, v1]] = [points[low], points[high]];
  return t1 > t0 ? v0 + ((v1 - v0) * Math.min(1, Math.max(0, (time - t0) / (t1 - t0)))) : v0;
}
