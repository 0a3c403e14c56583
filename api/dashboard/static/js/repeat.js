/** Do something again and again while the page is looked at, and at once when somebody comes back to it. */

/** @param {() => Promise<void>} act @param {number} everyMs @param {AbortSignal} signal ends it */
export function repeat(act, everyMs, signal) {
  let timer = 0;
  const again = () => {
    clearTimeout(timer);
    if (!signal.aborted && !document.hidden) timer = setTimeout(run, everyMs);
  };
  const run = () =>
    act()
      .catch(() => undefined) // asked again soon
      .finally(again);
  const onVisible = () => (document.hidden ? clearTimeout(timer) : run());
  document.addEventListener("visibilitychange", onVisible, { signal });
  signal.addEventListener("abort", () => clearTimeout(timer));
  again();
}
