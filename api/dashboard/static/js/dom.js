/** Elements from plain calls. Text always goes in as text, so nothing that a person typed is ever read as markup. */

const SVG = "http://www.w3.org/2000/svg";

/** An HTML element. @param {string} tag @param {object} [props] @param {...any} children @returns {HTMLElement} */
export function h(tag, props = {}, ...children) {
  return fill(document.createElement(tag), props, children);
}

/** An SVG element. @param {string} tag @param {object} [props] @param {...any} children @returns {SVGElement} */
export function s(tag, props = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), props, children);
}

/** Replace what an element holds. */
export function replace(element, ...children) {
  element.replaceChildren(...children.flat(Infinity).filter(present));
  return element;
}

const present = (child) => child !== null && child !== undefined && child !== false;

function fill(element, props, children) {
  for (const [name, value] of Object.entries(props ?? {})) set(element, name, value);
  element.append(...children.flat(Infinity).filter(present));
  return element;
}

function set(element, name, value) {
  if (!present(value)) return;
  if (name === "on") for (const [kind, react] of Object.entries(value)) element.addEventListener(kind, react);
  else if (name === "style") for (const [key, text] of Object.entries(value)) element.style.setProperty(key, text);
  else if (name === "dataset") Object.assign(element.dataset, value);
  else if (name === "value" || name === "checked" || name === "selected") element[name] = value;
  else element.setAttribute(name, value === true ? "" : String(value));
}
