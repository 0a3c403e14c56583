/** One application in the list; kept and changed in place, so that focus and picks stay where they are. */

import { h, replace } from "../dom.js";
import { methodName, moment, quantity } from "../format.js";
import { applicationLink, link } from "../router.js";
import { progressBar } from "./progress.js";
import { stateBadge } from "./state.js";

/** @param {any} item @param {(id: string, yes: boolean) => void} pick */
export function listRow(item, pick) {
  const box = h("input", {
    type: "checkbox",
    "aria-label": `Pick ${item.name}`,
    on: { change: () => pick(item.id, box.checked) },
  });
  const state = h("td", { class: "cell-state" });
  const best = h("td", { class: "figure cell-best" });
  const progress = progressBar(`Progress of ${item.name}`);
  const jobs = h("span", { class: "hint" });
  const element = h(
    "tr",
    {},
    h("td", { class: "cell-pick" }, box),
    h(
      "td",
      { class: "name" },
      h("a", { href: applicationLink(item.id) }, item.name),
      item.tags.map((tag) => h("a", { class: "tag", href: link("/", { tag }) }, tag)),
    ),
    state,
    h("td", { class: "cell-progress" }, progress.element, jobs),
    best,
    h("td", { class: "cell-created" }, h("time", { datetime: item.created_at }, moment(item.created_at))),
  );
  const row = { element, item, update, setPicked };
  let shown = "";

  function update(next) {
    row.item = next;
    const now = JSON.stringify([next.state, next.done, next.total, next.best]);
    if (now === shown) return;
    shown = now;
    replace(state, stateBadge(next.state));
    progress.update(next.done, next.total);
    jobs.textContent = `${next.done} of ${next.total} jobs`;
    replace(best, bestText(next.best));
  }

  function setPicked(yes) {
    box.checked = yes;
    element.setAttribute("aria-selected", String(yes));
  }

  return row;
}

function bestText(best) {
  if (!best) return "–";
  const of = `${methodName(best.method)}, ${best.tasks} task${best.tasks === 1 ? "" : "s"}`;
  return [quantity(best.value, best.unit), h("br"), h("span", { class: "hint" }, of)];
}
