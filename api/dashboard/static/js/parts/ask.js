/** Ask before something that cannot be undone. */

import { h } from "../dom.js";

/** @param {string} question @param {string} yes what the button says @returns {Promise<boolean>} */
export function ask(question, yes) {
  return new Promise((resolve) => {
    const dialog = h(
      "dialog",
      { class: "ask", "aria-label": question },
      h("p", {}, question),
      h(
        "div",
        { class: "buttons" },
        h("button", { type: "button", class: "quiet", on: { click: () => dialog.close("no") } }, "Keep"),
        h("button", { type: "button", class: "danger", on: { click: () => dialog.close("yes") } }, yes),
      ),
    );
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
