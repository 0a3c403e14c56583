/** A labelled input that knows which field of a request it is, and can say what is wrong with it. */

import { h } from "../dom.js";

let fields = 0;

/**
 * @param {string} path field of the request, as the server names it
 * @param {string} label
 * @param {HTMLElement} input
 * @param {string} [hint]
 */
export function field(path, label, input, hint = "") {
  const id = `field-${(fields += 1)}`;
  input.id = id;
  input.dataset.field = path;
  const note = hint ? h("span", { class: "hint", id: `${id}-hint` }, hint) : null;
  if (note) input.setAttribute("aria-describedby", note.id);
  const error = h("p", { class: "error", id: `${id}-error`, hidden: true });
  return h("div", { class: "field" }, h("label", { for: id }, label), input, note, error);
}

/** Forget what was wrong. @param {HTMLElement} form */
export function clearErrors(form) {
  for (const input of form.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
  for (const error of form.querySelectorAll(".error")) error.hidden = true;
}

/**
 * Show each error at its field, or at the field that holds it.
 *
 * @param {HTMLElement} form
 * @param {{field: string, message: string, limit?: string}[]} errors
 * @returns {{error: any, input: HTMLElement | null}[]}
 */
export function placeErrors(form, errors) {
  const inputs = [...form.querySelectorAll("[data-field]")].filter((input) => !input.closest("[hidden]"));
  return errors.map((error) => {
    const holders = inputs.filter((input) => holds(input.dataset.field, error.field));
    const input = holders.sort((a, b) => b.dataset.field.length - a.dataset.field.length)[0] ?? null;
    if (input) mark(input, error);
    return { error, input };
  });
}

/** Whether a path is a field or lies below it. */
export function holds(path, below) {
  return below === path || below.startsWith(`${path}.`) || below.startsWith(`${path}[`);
}

function mark(input, error) {
  input.setAttribute("aria-invalid", "true");
  const place = document.getElementById(`${input.id}-error`);
  if (!place) return;
  place.textContent = place.hidden ? error.message : `${place.textContent}; ${error.message}`;
  place.hidden = false;
  input.setAttribute("aria-errormessage", place.id);
}
