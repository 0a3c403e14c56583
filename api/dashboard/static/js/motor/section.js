/**
 * Outlines of a motor's cross-section in mm, motor axis at the origin. From the axis outwards: rotor iron, magnets that
 * end at R_ro, air gap, tooth tips with slot openings, teeth of constant width with slots between them, yoke, R_so.
 */

const ARC_POINTS = 10;

/** @typedef {[number, number][]} Outline */

/**
 * @param {Record<string, number>} d the seven lengths [mm]
 * @param {any} motor constants of the application
 */
export function motorSection(d, motor) {
  const bore = d.R_ro + motor.air_gap_mm;
  const slotInner = bore + motor.tooth_tip_height_mm;
  const slotOuter = d.R_so - d.h_sy;
  const pitch = (2 * Math.PI) / motor.slots;
  const pole = Math.PI / motor.pole_pairs;
  const half = motor.magnet_arc_rad / motor.pole_pairs / 2;
  const magnet = ring(d.R_ro - d.h_m, d.R_ro, -half, half);
  const room = slotOuter > slotInner && d.w_tooth < 2 * slotInner;
  const slot = room ? slotOutline(d.w_tooth, slotInner, slotOuter, pitch) : [];
  const opening = strip(Math.min(d.b_0, 2 * bore), bore, slotInner, pitch / 2);
  return {
    stackLength: d.L,
    magnetInner: d.R_ro - d.h_m,
    rotorRadius: d.R_ro,
    bore,
    slotInner,
    slotOuter,
    statorRadius: d.R_so,
    slots: around(slot, motor.slots, pitch),
    openings: around(opening, motor.slots, pitch),
    magnets: around(magnet, 2 * motor.pole_pairs, pole),
    pitch,
  };
}

/** Half the angle under which a strip of a width cuts a circle [rad]. */
export const halfAngle = (width, radius) => Math.asin(Math.min(1, width / (2 * radius)));

/** Between tooth 0 and tooth 1, whose sides are parallel to their own axes. */
function slotOutline(width, inner, outer, pitch) {
  const low = halfAngle(width, inner);
  const high = halfAngle(width, outer);
  return [...arc(outer, high, pitch - high), ...arc(inner, pitch - low, low)];
}

function strip(width, inner, outer, angle) {
  const low = halfAngle(width, inner);
  const high = halfAngle(width, outer);
  return [...arc(outer, angle - high, angle + high), ...arc(inner, angle + low, angle - low)];
}

const ring = (inner, outer, start, stop) => [...arc(outer, start, stop), ...arc(inner, stop, start)];

function arc(radius, start, stop) {
  return Array.from({ length: ARC_POINTS }, (_, k) => {
    const angle = start + ((stop - start) * k) / (ARC_POINTS - 1);
    return [radius * Math.cos(angle), radius * Math.sin(angle)];
  });
}

function around(outline, copies, step) {
  return Array.from({ length: copies }, (_, k) => {
    const [c, sn] = [Math.cos(k * step), Math.sin(k * step)];
    return outline.map(([x, y]) => [c * x - sn * y, sn * x + c * y]);
  });
}
