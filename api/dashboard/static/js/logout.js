/** The button that logs out, there while somebody is logged in. */

import { get, remove } from "./api.js";

/** @param {HTMLButtonElement} button @param {() => void} then */
export function installLogout(button, then) {
  button.addEventListener("click", async () => {
    await remove("/v1/session");
    await showLogout(button);
    then();
  });
  return showLogout(button);
}

/** Ask who is logged in. @param {HTMLButtonElement} button */
export async function showLogout(button) {
  const session = await get("/v1/session").catch(() => null);
  button.hidden = !session?.name;
  if (session?.name) button.title = `Logged in with the key of ${session.name}`;
}
