/** Names and units that answers do not carry: a motor's seven lengths, in the order of every design, and objectives. */

export const DIMENSIONS = ["L", "R_ro", "R_so", "h_m", "h_sy", "w_tooth", "b_0"];

export const DIMENSION_NAMES = {
  L: "stack length",
  R_ro: "rotor outer radius",
  R_so: "stator outer radius",
  h_m: "magnet height",
  h_sy: "stator yoke height",
  w_tooth: "tooth width",
  b_0: "slot opening",
};

/** A symbol in two parts: letter and index. @param {string} name */
export function symbolParts(name) {
  const [letter, ...index] = name.split("_");
  return [letter, index.join(" ")];
}

/** Of an objective's value, by its kind; on the wire. */
export const OBJECTIVE_UNITS = { time: "s", energy: "V2 s", weighted: "1", electrical_energy: "J" };
