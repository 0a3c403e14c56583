/** Cancel, end a search, retry, delete: those that make sense now. */

import { announce } from "../announce.js";
import { ofApplication, post, remove } from "../api.js";
import { h, replace } from "../dom.js";
import { isFinal } from "../format.js";
import { ask } from "./ask.js";

/**
 * @param {HTMLElement} place where the buttons go
 * @param {any} status
 * @param {{changed: () => void, failed: (error: Error) => void}} tell
 */
export function showActions(place, status, tell) {
  const wanted = actions(status);
  if (place.dataset.shown === wanted.join()) return;
  place.dataset.shown = wanted.join();
  const button = (text, kind, act) =>
    h("button", { type: "button", class: kind, on: { click: (event) => run(event.currentTarget, act, tell) } }, text);
  const id = status.id;
  replace(
    place,
    wanted.includes("cancel") && button("Cancel", "quiet", () => done(post(ofApplication(id, "/cancel")), "cancelling")),
    wanted.includes("stop search") &&
      button("Use best so far", "quiet", () => done(post(ofApplication(id, "/stop_search")), "goes on with the best design so far")),
    wanted.includes("retry") && button("Retry failed", "quiet", () => done(post(ofApplication(id, "/retry")), "queued again")),
    button("Delete", "danger", async () => {
      if (!(await ask(`Delete “${status.name}” with all its results? This cannot be undone.`, "Delete it"))) return;
      await done(remove(ofApplication(id)), "deleted");
      location.hash = "#/";
    }),
  );
}

function actions(status) {
  if (!isFinal(status.state)) {
    if (status.cancel_requested) return ["cancelling"];
    return status.search === "running" ? ["stop search", "cancel"] : ["cancel"];
  }
  return status.state === "succeeded" ? [] : ["retry"];
}

async function done(request, what) {
  await request;
  announce(`Application ${what}`);
}

async function run(button, act, tell) {
  button.disabled = true;
  try {
    await act();
    tell.changed();
  } catch (error) {
    tell.failed(error);
  } finally {
    button.disabled = false;
  }
}
