/** How the solver came to a motion: its attempts and its iterations. */

import { h } from "../dom.js";
import { count, duration, number, words } from "../format.js";

/** @param {any} log */
export function solverLog(log) {
  if (!log) return h("p", { class: "empty" }, "Not solved yet.");
  const lines = log.iterations.map((i) => `${String(i.attempt).padStart(3)} ${String(i.iteration).padStart(5)}  ${i.objective.toExponential(8)}`);
  return [
    h("p", {}, h("strong", {}, words(log.solver_status ?? "no status")), log.reason ? `: ${log.reason}` : ""),
    h(
      "ol",
      { class: "reasons" },
      log.attempts.map((a) =>
        h("li", {}, `${words(a.name ?? "attempt")}: ${words(a.solver_status ?? "")}, ${count(a.iterations ?? 0, "iteration")}, ${duration(a.solve_time_s)}`),
      ),
    ),
    lines.length
      ? h("details", {}, h("summary", {}, `${count(lines.length, "iteration")}, last objective ${number(log.iterations.at(-1).objective)} (scaled)`), h("pre", { class: "log", tabindex: "0" }, `try  iter  objective\n${lines.join("\n")}`))
      : null,
  ];
}
