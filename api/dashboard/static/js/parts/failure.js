/** What went wrong, in the server's words. */

import { h } from "../dom.js";

/** @param {Error} error @returns {HTMLElement} */
export function failure(error) {
  const away = error instanceof TypeError; // fetch found nobody
  const text = away ? "The server does not answer. It is asked again when the page is loaded anew." : error.message;
  return h("div", { class: "notice bad", role: "alert" }, text);
}
