/** Say something to people who do not see the page change. */

let last = "";

/** @param {string} text */
export function announce(text) {
  if (text === last) return;
  last = text;
  document.getElementById("announcements").textContent = text;
}
