/** Look again, now and then, whether an application has come further, until it has ended. */

import { get, ofApplication } from "../api.js";
import { isFinal } from "../format.js";
import { repeat } from "../repeat.js";

const EVERY_MS = 3000;
const far = (status) => `${status.state} ${status.progress.done}`;

/** @param {any} status as it is shown @param {AbortSignal} signal @param {(status: any) => any} react */
export function whenChanged(status, signal, react) {
  if (isFinal(status.state)) return;
  let known = status;
  const look = async () => {
    if (isFinal(known.state)) return;
    const next = await get(ofApplication(status.id), signal);
    const changed = far(next) !== far(known);
    known = next;
    if (changed && !signal.aborted) await react(next);
  };
  repeat(look, EVERY_MS, signal);
}

/** Whether the stage that finds a method's design has ended. */
export function designSought(status, method = status.method) {
  const name = method === "shared_optimum" ? method : "reconcile";
  return status.progress.stages.some((stage) => stage.name === name && stage.succeeded + stage.failed > 0);
}
