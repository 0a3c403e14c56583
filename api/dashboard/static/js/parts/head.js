/** What every page of an application begins with: its name, its state, and the way to its other pages. */

import { ofApplication } from "../api.js";
import { h } from "../dom.js";
import { methodName, words } from "../format.js";
import { applicationLink } from "../router.js";
import { stateBadge } from "./state.js";

const PAGES = [
  ["", "Tasks"],
  ["/design", "Design"],
  ["/designs", "Designs"],
  ["/comparison", "Comparison"],
];

const OBJECTIVES = {
  time: "shortest time [s]",
  energy: "least ∫u'u [V²s]",
  electrical_energy: "least electrical energy [J]",
};

/** @param {any} status of the application @param {string} here rest of the address of this page */
export function head(status, here) {
  const state = h("span", { class: "head-state" }, stateBadge(status.state));
  const buttons = h("div", { class: "buttons" });
  const element = h(
    "header",
    { class: "head" },
    h("p", { class: "crumbs" }, h("a", { href: "#/" }, "Applications"), " / "),
    h("div", { class: "head-line" }, h("h1", {}, status.name), state, buttons),
    h(
      "p",
      { class: "about" },
      `${status.robot} · ${objectiveText(status.objective)} · ${methodName(status.method)}`,
      status.tags.map((tag) => h("a", { class: "tag", href: `#/?${new URLSearchParams({ tag })}` }, tag)),
    ),
    h(
      "nav",
      { class: "tabs", "aria-label": "Application" },
      PAGES.map(([rest, text]) =>
        h("a", { href: applicationLink(status.id, rest), "aria-current": rest === here ? "page" : null }, text),
      ),
      h("a", { href: ofApplication(status.id, "/report") }, "Report"),
    ),
  );
  return { element, buttons, setState: (next) => state.replaceChildren(stateBadge(next)) };
}

/** What is minimised. */
export function objectiveText(objective) {
  if (objective.kind === "weighted") return `weighted: ${objective.alpha} energy, ${1 - objective.alpha} time`;
  return OBJECTIVES[objective.kind] ?? words(objective.kind);
}
