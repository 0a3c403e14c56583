/** How the best design for all tasks was found: its convergence, what it took, and which tasks decide. */

import { h } from "../dom.js";
import { count, duration, methodName, number } from "../format.js";
import { convergencePlot } from "../plots/convergence.js";
import { applicationLink } from "../router.js";

/** @param {any} found the `shared_optimum` of a designs answer @returns {Element | null} */
export function jointSolve(found, status, unit) {
  if (!found?.convergence?.length) return null;
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "How the shared optimum was found"),
    h("p", { class: "hint" }, "All motions and the one design are variables of one program; the line is where it ended."),
    convergencePlot(found.convergence, unit),
    h("dl", { class: "facts" }, facts(found).map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
    deciding(found.deciding_tasks, status),
  );
}

function facts(found) {
  return [
    ["Started from the design of", found.start === null ? null : methodName(found.start)],
    ["Iterations", found.iterations],
    ["Time in the solver", found.solve_time_s === null ? null : duration(found.solve_time_s)],
    ["KKT residual, scaled", found.kkt_residual === null ? null : number(found.kkt_residual, 2)],
    ["Constraints violated by, scaled", found.constraint_violation === null ? null : number(found.constraint_violation, 2)],
  ].filter(([, value]) => value !== null && value !== undefined);
}

/** Over the worst task: those that keep it from falling. */
function deciding(tasks, status) {
  if (!tasks?.length) return null;
  return h(
    "p",
    {},
    `${count(tasks.length, "task")} decide${tasks.length === 1 ? "s" : ""}: `,
    tasks.map((task, k) => [
      k ? ", " : "",
      h("a", { href: applicationLink(status.id, `/tasks/${task.index}`) }, task.name),
      ` (${number(100 * task.share, 2)} %)`,
    ]),
  );
}
