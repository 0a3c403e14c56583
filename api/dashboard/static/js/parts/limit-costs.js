/** Limits that bind with a method, and what relaxing each a little would bring. */

import { h } from "../dom.js";
import { aligned, methodName, number, quantity, unit } from "../format.js";

export function limitCosts(comparison, method) {
  const costs = comparison.limits[method];
  const percents = aligned(costs.map((cost) => cost.gain_per_percent), comparison.unit);
  const columns = ["Value", "Relax", "Binds in", "Gain per unit", "Gain for 1 %"];
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h("caption", {}, methodName(method)),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Limit"), columns.map((name) => h("th", { scope: "col", class: "figure" }, name)))),
      h(
        "tbody",
        {},
        costs.map((cost, k) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, cost.name),
            h("td", { class: "figure" }, cost.value === null ? "differs" : quantity(cost.value, cost.unit)),
            h("td", { class: "figure" }, cost.relax),
            h("td", { class: "figure" }, cost.tasks.length ? `${cost.tasks.length} of ${comparison.tasks_compared.length} tasks` : "the design"),
            h("td", { class: "figure" }, `${number(cost.gain_per_unit, 3)} ${perUnit(comparison.unit, cost.unit)}`),
            h("td", { class: "figure" }, percents[k]),
          ),
        ),
      ),
    ),
  );
}

const perUnit = (objective, limit) => `${unit(objective) || "1"}/${limit.includes("/") ? `(${limit})` : limit}`;
