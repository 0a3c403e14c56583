/** Show a key once; from then on the browser keeps a cookie that no script can read. */

import { logIn } from "../api.js";
import { h } from "../dom.js";
import { field } from "../submit/field.js";

/** @param {() => void} then what to do once logged in @returns {{title: string, element: HTMLElement}} */
export function loginPage(then) {
  const key = h("input", { type: "password", autocomplete: "current-password", required: true, maxlength: 200 });
  const labelled = field("key", "API key", key, "from your operator: armature key create NAME");
  const error = labelled.querySelector(".error");
  error.setAttribute("role", "alert");

  async function send(event) {
    event.preventDefault();
    error.hidden = true;
    key.removeAttribute("aria-invalid");
    try {
      await logIn(key.value);
      then();
    } catch (problem) {
      error.textContent = problem.message;
      error.hidden = false;
      key.setAttribute("aria-invalid", "true");
      key.focus();
    }
  }

  const button = h("button", { type: "submit" }, "Log in");
  const form = h("form", { class: "form", on: { submit: send } }, labelled, h("div", { class: "buttons" }, button));
  return { title: "Log in", element: h("div", { class: "page" }, h("h1", {}, "Log in"), form) };
}
