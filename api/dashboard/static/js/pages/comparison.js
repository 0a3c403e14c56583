/** The methods side by side: totals, regret, and where one is better than another. */

import { get, ofApplication } from "../api.js";
import { h, replace } from "../dom.js";
import { aligned, count, methodName, signed } from "../format.js";
import { limitCosts } from "../parts/limit-costs.js";
import { head } from "../parts/head.js";
import { whenChanged } from "../parts/when-changed.js";
import { heatKey, heatMap, percentCell, taskLink } from "../plots/heat.js";

export async function show(at, signal) {
  const { id } = at.params;
  const read = (rest) => get(ofApplication(id, rest), signal);
  const [status, comparison, overview] = await Promise.all(["", "/comparison", "/overview"].map(read));
  const top = head(status, "/comparison");
  const body = h("div", { class: "page" }, content(status, comparison, overview));
  whenChanged(status, signal, async (next) => {
    top.setState(next.state);
    const [compared, seen] = await Promise.all(["/comparison", "/overview"].map(read));
    replace(body, content(next, compared, seen));
  });
  return { title: `Comparison of ${status.name}`, element: h("div", { class: "page" }, top.element, body) };
}

function content(status, comparison, overview) {
  const others = overview.methods.filter((name) => name !== status.method && name in comparison.methods);
  return [
    totals(status, comparison, overview),
    others.length && status.method in comparison.methods ? improvements(status, overview, others) : null,
    Object.keys(comparison.regret).length && comparison.tasks_compared.length ? regrets(overview, comparison) : null,
    scattered(status, comparison, overview),
    limits(status, comparison),
  ];
}

/** Each task as given, over its random samples. */
function scattered(status, comparison, overview) {
  if (!comparison.scattered.length) return null;
  const names = [status.method, ...overview.methods.filter((name) => name !== status.method), "own"].filter((name) => name in comparison.methods);
  const cell = ({ mean, standard_deviation: deviation, largest }) => {
    const [middle, spread, most] = aligned([mean, deviation, largest], comparison.unit);
    return `${middle} ± ${spread}, at most ${most}`;
  };
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "Over the samples"),
    h("p", { class: "hint" }, "Mean and standard deviation of the objective over each task's samples, and the largest."),
    h(
      "div",
      { class: "scroll" },
      h(
        "table",
        { class: "records tight" },
        h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Task"), ["Samples", ...names.map(methodName)].map((text) => h("th", { scope: "col", class: "figure" }, text)))),
        h(
          "tbody",
          {},
          comparison.scattered.map((task) =>
            h(
              "tr",
              {},
              h("th", { scope: "row" }, task.name),
              h("td", { class: "figure" }, String(task.samples)),
              names.map((name) => h("td", { class: "figure" }, cell(task.methods[name]))),
            ),
          ),
        ),
      ),
    ),
  );
}

/** What relaxing each limit would bring: with the application's design, and with each task's own. */
function limits(status, comparison) {
  const shown = [status.method, "own"].filter((name) => comparison.limits[name]?.length);
  if (!shown.length) return null;
  const hint = "By the multipliers at each optimum, for a small change. With a design that is not free, the motions alone adapt.";
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "Limits that hold it back"),
    h("p", { class: "hint" }, hint),
    shown.map((name) => limitCosts(comparison, name)),
  );
}

function totals(status, comparison, overview) {
  const names = ["own", ...overview.methods].filter((name) => name in comparison.methods);
  const compared = comparison.tasks_compared.length;
  const all = overview.tasks.length;
  return h(
    "section",
    { class: "card" },
    h("h2", {}, `Totals over ${compared === all ? count(all, "task") : `the ${compared} of ${all} tasks that every method solved`}`),
    Object.entries(comparison.missing).map(([name, why]) => h("p", { class: "notice" }, `${methodName(name)} ${why}.`)),
    compared === 0 ? h("p", { class: "empty" }, "Nothing to compare yet.") : totalsTable(status, comparison, names),
    isJudgedApart(comparison) ? h("p", { class: "hint" }, "Judged by: what the design is for, the objective over the tasks with their weights, their sum or the worst as asked.") : null,
    undone(comparison, names).map((text) => h("p", { class: "notice" }, text)),
    h("p", { class: "hint" }, "Regret: how much more the objective is than with motors of each task's own, which is a bound for every method."),
  );
}

/** Whether weights or the worst task make what a design is judged by another figure than the plain total. */
function isJudgedApart(comparison) {
  return Object.entries(comparison.judged).some(([name, value]) => Math.abs(value - comparison.methods[name].total_objective) > 1e-9 * Math.abs(value));
}

/** Who cannot do every task, since totals leave those tasks out for all. */
function undone(comparison, names) {
  const left = (name) => comparison.unsolved[name]?.length ?? 0;
  return names.filter((name) => left(name) > 0).map((name) => `${methodName(name)}: no motion for ${count(left(name), "task")}.`);
}

function totalsTable(status, comparison, names) {
  const columns = [
    ["Objective", "total_objective", comparison.unit],
    ["Time", "total_time_s", "s"],
    ["Energy ∫u'u", "total_energy_V2s", "V2 s"],
    ["Electrical energy", "total_electrical_energy_J", "J"],
    ["Copper loss", "total_copper_loss_J", "J"],
  ]
    .slice(status.objective.kind === "weighted" ? 0 : 1)
    .map(([label, key, wire]) => [label, aligned(names.map((name) => comparison.methods[name][key]), wire)]);
  if (isJudgedApart(comparison)) columns.unshift(["Judged by", aligned(names.map((name) => comparison.judged[name]), comparison.unit)]);
  const regret = (name) => {
    const total = comparison.regret[name]?.total;
    return name === "own" ? "bound" : total === null || total === undefined ? "–" : `${signed(100 * total)} %`;
  };
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Design"), [...columns.map(([text]) => text), "Regret"].map((text) => h("th", { scope: "col", class: "figure" }, text)))),
      h(
        "tbody",
        {},
        names.map((name, k) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, methodName(name), name === status.method ? h("span", { class: "tag" }, "chosen") : null),
            columns.map(([, printed]) => h("td", { class: "figure" }, printed[k])),
            h("td", { class: "figure" }, regret(name)),
          ),
        ),
      ),
    ),
  );
}

/** How much the application's method improves on each other one, of the other's objective. */
function improvements(status, overview, others) {
  const maps = others.map((other) => [other, improvement(overview, status.method, other)]);
  const name = methodName(status.method);
  return h(
    "section",
    { class: "card" },
    h("h2", {}, `Improvement by ${name} [%]`),
    heatKey(`${name} worse`, `${name} better`),
    h(
      "div",
      { class: "columns maps" },
      maps.map(([other, percent]) => percentages(overview, percent, 1, `over ${methodName(other)}`, status.method, [status.method, other])),
    ),
  );
}

function regrets(overview, comparison) {
  const maps = Object.entries(comparison.regret).map(([method, regret]) => {
    const known = comparison.tasks_compared.map((task, k) => [task, regret.per_task[k]]).filter(([, value]) => value !== null);
    return [method, new Map(known.map(([task, value]) => [task, 100 * value]))];
  });
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "Regret of each task [%]"),
    heatKey("worse than its own design", "better"),
    h("div", { class: "columns maps" }, maps.map(([method, percent]) => percentages(overview, percent, -1, methodName(method), method, ["own", method]))),
  );
}

/** @returns {Map<number, number>} percent by task, where both have a motion */
function improvement(overview, ours, theirs) {
  const found = overview.tasks.map((task) => [task.index, task.outcomes[ours]?.value, task.outcomes[theirs]?.value]);
  return new Map(
    found
      .filter(([, mine, other]) => Number.isFinite(mine) && Number.isFinite(other) && other !== 0)
      .map(([index, mine, other]) => [index, (100 * (other - mine)) / Math.abs(other)]),
  );
}

function percentages(overview, percent, good, caption, method, pair) {
  const about = (task) => ({
    text: whoSolved(overview.tasks[task], pair),
    label: overview.tasks[task].name,
    href: taskLink(overview.application_id, task, method),
  });
  if (overview.grid) return heatMap(overview.grid, percent, good, caption, about);
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h("caption", {}, caption),
      h("tbody", {}, overview.tasks.map((task) => h("tr", {}, h("th", { scope: "row" }, task.name), h("td", {}, percentCell(percent.get(task.index), good, about(task.index)))))),
    ),
  );
}

function whoSolved(task, pair) {
  const solved = pair.filter((name) => Number.isFinite(task.outcomes[name]?.value));
  return solved.length === 1 ? `only ${methodName(solved[0])}` : "none";
}
