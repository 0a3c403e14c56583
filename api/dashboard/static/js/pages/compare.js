/** Two applications side by side: what they are, their totals, and their motors. */

import { get, getIfThere, ofApplication } from "../api.js";
import { h, replace, s } from "../dom.js";
import { count, fixed, methodName, moment, quantity, signed } from "../format.js";
import { across, along } from "../motor/drawing.js";
import { motorSection } from "../motor/section.js";
import { DIMENSION_NAMES, DIMENSIONS } from "../names.js";
import { objectiveText } from "../parts/head.js";
import { stateBadge } from "../parts/state.js";
import { symbol } from "../parts/symbol.js";
import { designSought } from "../parts/when-changed.js";
import { applicationLink, rememberQuery } from "../router.js";

const OFFERED = 200;
const MEASURES = [
  ["Objective", "total_objective", null],
  ["Time", "total_time_s", "s"],
  ["Energy ∫u'u", "total_energy_V2s", "V2 s"],
  ["Electrical energy", "total_electrical_energy_J", "J"],
  ["Copper loss", "total_copper_loss_J", "J"],
];

export async function show(at, signal) {
  const recent = (await get(`/v1/applications?limit=${OFFERED}`, signal)).items;
  const chosen = {
    a: at.query.get("a") ?? recent[0]?.id ?? null,
    b: at.query.get("b") ?? recent[1]?.id ?? recent[0]?.id ?? null,
  };
  const content = h("div", { class: "page" });

  async function update() {
    rememberQuery(chosen);
    if (chosen.a === null) {
      replace(content, h("p", { class: "empty" }, "There is no application yet. ", h("a", { href: "#/submit" }, "Submit one.")));
      return;
    }
    const sides = await Promise.all([load(chosen.a, signal), load(chosen.b, signal)]);
    replace(content, sideBySide(sides));
  }

  const picker = (side, label) =>
    h(
      "label",
      { class: "grow" },
      label,
      h("select", { on: { change: (event) => ((chosen[side] = event.target.value), update()) } }, options(recent, chosen[side])),
    );
  await update();
  const element = h(
    "div",
    { class: "page" },
    h("h1", {}, "Compare two applications"),
    h("div", { class: "filters" }, picker("a", "A"), picker("b", "B")),
    content,
  );
  return { title: "Compare", element };
}

function options(recent, chosen) {
  const known = recent.some((item) => item.id === chosen);
  return [
    known || chosen === null ? null : h("option", { value: chosen, selected: true }, chosen),
    recent.map((item) => h("option", { value: item.id, selected: item.id === chosen }, `${item.name}, ${moment(item.created_at)}`)),
  ];
}

async function load(id, signal) {
  const [status, resolved, comparison] = await Promise.all(
    ["", "/resolved", "/comparison"].map((rest) => get(ofApplication(id, rest), signal)),
  );
  const design = designSought(status) ? await getIfThere(ofApplication(id, "/design"), signal) : null;
  return { status, resolved, comparison, design };
}

function sideBySide([a, b]) {
  return [
    h("div", { class: "columns" }, [a, b].map((side, k) => summary(side, "AB"[k]))),
    totals(a, b),
    a.design && b.design ? motors(a, b) : h("p", { class: "empty" }, "Not both have a design yet."),
  ];
}

function summary({ status }, letter) {
  const lines = [
    ["Robot", status.robot],
    ["Objective", objectiveText(status.objective)],
    ["Tasks", String(status.tasks)],
    ["Method", methodName(status.method)],
    ["Created", moment(status.created_at)],
  ];
  return h(
    "section",
    { class: "card" },
    h("header", {}, h("h2", {}, `${letter}: `, h("a", { href: applicationLink(status.id) }, status.name)), stateBadge(status.state)),
    h("dl", { class: "facts" }, lines.map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)])),
  );
}

function totals(a, b) {
  const names = [...new Set([a, b].flatMap(({ comparison }) => Object.keys(comparison.methods)))];
  const same = a.comparison.unit === b.comparison.unit;
  const measures = same && a.status.objective.kind === "weighted" ? MEASURES : MEASURES.slice(1);
  const rows = names.flatMap((name) =>
    measures.map(([label, key, unit], k) => {
      const [x, y] = [a, b].map(({ comparison }) => comparison.methods[name]?.[key]);
      return h(
        "tr",
        { class: k === 0 ? "first" : null },
        k === 0 ? h("th", { scope: "rowgroup", rowspan: measures.length }, methodName(name)) : null,
        h("td", {}, label),
        [x, y].map((value) => h("td", { class: "figure" }, quantity(value, unit ?? a.comparison.unit))),
        h("td", { class: "figure" }, change(x, y)),
      );
    }),
  );
  const counted = [a, b].map(({ comparison }) => comparison.tasks_compared.length);
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "Totals"),
    counted[0] === counted[1] ? null : h("p", { class: "notice" }, `A is summed over ${count(counted[0], "task")}, B over ${counted[1]}.`),
    table(["Design", "Total", "A", "B", "B against A"], rows),
  );
}

function motors(a, b) {
  const sections = [a, b].map((side) => side.design.motors.map((sheet) => motorSection(sheet.dimensions_mm, side.resolved.motor)));
  const all = sections.flat();
  const room = { widest: Math.max(...all.map((x) => x.statorRadius)), longest: Math.max(...all.map((x) => x.stackLength)) };
  const joints = Math.max(a.design.motors.length, b.design.motors.length);
  return h(
    "section",
    { class: "card" },
    h("h2", {}, "Motors, all to one scale"),
    h("div", { class: "pairs" }, Array.from({ length: joints }, (_, k) => pair(k, [a, b], sections, room))),
  );
}

function pair(k, sides, sections, room) {
  const [x, y] = sides.map((side) => side.design.motors[k]?.dimensions_mm);
  const rows = DIMENSIONS.map((name) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, symbol(name), h("span", { class: "visually-hidden" }, ` ${DIMENSION_NAMES[name]}`)),
      [x, y].map((d) => h("td", { class: "figure" }, d ? fixed(d[name], 2) : "–")),
      h("td", { class: "figure" }, change(x?.[name], y?.[name])),
    ),
  );
  return h(
    "div",
    { class: "pair" },
    h("h3", {}, `Motor ${k + 1}`),
    h("div", { class: "twins" }, sections.map((side, j) => (side[k] ? drawing(side[k], room, "AB"[j]) : null))),
    table(["[mm]", "A", "B", ""], rows),
  );
}

function drawing(section, { widest, longest }, letter) {
  const box = [-widest - 1, -widest - 1, 2 * widest + 2, 2 * widest + longest + 10];
  return h(
    "figure",
    {},
    s(
      "svg",
      { class: "drawing", viewBox: box.join(" "), role: "img", "aria-label": `Motor of ${letter}, across and along its axis` },
      across(section),
      s("g", { transform: `translate(0 ${widest + 5})` }, along(section)),
    ),
    h("figcaption", {}, letter),
  );
}

function change(x, y) {
  if (!Number.isFinite(x) || !Number.isFinite(y) || x === 0) return "–";
  return `${signed((100 * (y - x)) / Math.abs(x))} %`;
}

function table(heads, rows) {
  return h(
    "div",
    { class: "scroll" },
    h(
      "table",
      { class: "records tight" },
      h("thead", {}, h("tr", {}, heads.map((text, k) => (text ? h("th", { scope: "col", class: k > 0 && text !== "Total" ? "figure" : null }, text) : h("td"))))),
      h("tbody", {}, rows),
    ),
  );
}
