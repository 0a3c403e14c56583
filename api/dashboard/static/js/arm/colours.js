/** The page's colours as numbers, for the canvas; they change with the theme. */

const NAMES = {
  link: "--rotor",
  motor: "--stator",
  cap: "--copper",
  ball: "--purple",
  line: "--line",
  quiet: "--quiet",
  path: "--orange",
};

/** @param {HTMLElement} element that stands in the page @returns {Record<string, number[]>} */
export function colours(element) {
  const before = element.style.color;
  const found = Object.entries(NAMES).map(([name, property]) => {
    element.style.color = `var(${property})`;
    const channels = getComputedStyle(element).color.match(/[\d.]+/g) ?? ["128", "128", "128"];
    return [name, channels.slice(0, 3).map(Number)];
  });
  element.style.color = before;
  return Object.fromEntries(found);
}
