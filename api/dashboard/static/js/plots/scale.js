/** From values to places on the page, and round values to write beside an axis. */

/** @param {[number, number]} domain @param {[number, number]} range @returns {(value: number) => number} */
export function linear([low, high], [from, to]) {
  const span = high - low || 1;
  return (value) => from + ((value - low) / span) * (to - from);
}

/** About `wanted` round values in [low, high]. @returns {number[]} */
export function ticks(low, high, wanted = 4) {
  if (!(high > low)) return [low];
  const rough = (0.7 * (high - low)) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) values.push(k * step);
  return values;
}
