/** Follow an application's events, from a number on, across broken connections and hidden pages. */

import { ofApplication } from "./api.js";

const KINDS = ["job", "stage", "iteration", "compiling", "cancel", "stop_search", "application", "pruned"];
const AGAIN_MS = 2000;

/**
 * The browser itself comes back with `Last-Event-ID` when a connection breaks; when it gives up, so do we for a moment.
 *
 * @param {string} id
 * @param {number} after number of the latest event that is already known
 * @param {(kind: string, content: any) => void} react
 * @param {AbortSignal} signal ends it
 */
export function follow(id, after, react, signal) {
  let source = null;
  let timer = 0;
  let last = after;
  let over = false;

  function open() {
    if (source !== null || over || signal.aborted || document.hidden) return;
    source = new EventSource(ofApplication(id, `/events?after=${last}`));
    for (const kind of KINDS) source.addEventListener(kind, receive);
    source.addEventListener("error", () => {
      if (source?.readyState !== EventSource.CLOSED) return;
      close();
      timer = setTimeout(open, AGAIN_MS);
    });
  }

  function close() {
    clearTimeout(timer);
    source?.close();
    source = null;
  }

  function receive(event) {
    if (event.lastEventId) last = Number(event.lastEventId);
    const content = JSON.parse(event.data);
    if (event.type === "application" && !["queued", "running"].includes(content.state)) {
      over = true;
      close();
    }
    react(event.type, content);
  }

  // A hidden page holds no connection: browsers allow few of them.
  document.addEventListener("visibilitychange", () => (document.hidden ? close() : open()), { signal });
  signal.addEventListener("abort", close);
  open();
}

/** A function that acts soon after it is called, once for many calls, never twice at a time. */
export function soon(act, afterMs) {
  let waiting = false;
  let running = false;
  return function call() {
    if (waiting) return;
    waiting = true;
    setTimeout(async () => {
      waiting = false;
      if (running) {
        call();
        return;
      }
      running = true;
      await Promise.resolve(act()).catch(() => undefined);
      running = false;
    }, afterMs);
  };
}
