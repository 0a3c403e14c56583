/** The form of an application; what it cannot say, YAML can. */

import { h } from "../dom.js";
import { methodName, words } from "../format.js";
import { choice } from "../parts/choice.js";
import { field } from "./field.js";
import { given, indexOrName, manyNumbers, oneNumber } from "./numbers.js";
import { robotUpload } from "./robot-upload.js";
import { taskRows } from "./task-rows.js";

const OBJECTIVES = {
  time: "time: as fast as the motors allow",
  energy: "energy: least ∫u'u [V²s] in a given duration",
  electrical_energy: "electrical energy: least [J] in a given duration",
  weighted: "weighted: a mix of time and energy",
};

/** The server's own. */
const DEFAULT_ROBOT = "ur5";

/** What the paper compares with. */
const COMPARED = ["empirical", "worst_case"];

/**
 * @param {{objectives: string[], methods: string[], robots: {id: string, name: string, description: string}[]}} offered
 * @returns {{element: HTMLElement, value: () => any}}
 */
export function applicationForm(offered) {
  const text = (value = "", more = {}) => h("input", { type: "text", value, autocomplete: "off", ...more });
  const decimal = (value = "") => text(value, { inputmode: "decimal" });
  const select = (options, react) =>
    h("select", { on: { change: react ?? (() => undefined) } }, options.map(([value, label]) => h("option", { value }, label)));

  const name = text("", { maxlength: 200 });
  const tags = text();
  const robot = select(offered.robots.map((r) => [r.id, r.kind === "upload" ? `${r.name} (${r.id})` : r.name]));
  if (offered.robots.some((r) => r.id === DEFAULT_ROBOT)) robot.value = DEFAULT_ROBOT;
  const upload = robotUpload(({ id, name: label }) => {
    robot.append(h("option", { value: id }, `${label} (${id})`));
    robot.value = id;
  });
  const objective = select(offered.objectives.map((kind) => [kind, OBJECTIVES[kind] ?? words(kind)]), showParts);
  const alpha = decimal("0.5");
  const stroke = text("0.2, 0.4, 0.6, 0.8, 1.0");
  const payload = text("0, 1, 2, 3, 4");
  const duration = decimal();
  const list = taskRows();
  const method = select(offered.methods.map((m) => [m, methodName(m)]));
  const compare = offered.methods.map((m) => h("input", { type: "checkbox", value: m, checked: COMPARED.includes(m) }));
  const empirical = text();
  const worst = text();
  const precise = decimal();
  const intervals = text("50", { inputmode: "numeric" });
  const degree = text("1", { inputmode: "numeric" });
  const scheme = select([["radau", "radau"], ["legendre", "legendre"]]);
  const control = select([["voltage", "voltage, constant on each interval"], ["current", "current, linear on each interval"]]);
  const motor = Object.fromEntries(["current_limit_A", "voltage_limit_V", "mass_limit_kg", "turns_per_tooth"].map((m) => [m, decimal()]));

  let kindOfTasks = "grid";
  let kindOfGrid = "accuracy";
  const alphaField = field("objective.alpha", "Weight of energy, 0 to 1", alpha);
  const gridPart = h(
    "div",
    { class: "fields" },
    field("tasks.grid.stroke", "Strokes [rad]", stroke, "from stroke × (1, …, 1) to 0"),
    field("tasks.grid.payload_kg", "Payloads [kg]", payload, "every stroke with every payload"),
    field("tasks.grid.duration_s", "Duration [s]", duration, "needed for energy"),
  );
  const accuracyPart = h(
    "div",
    { class: "fields" },
    field("transcription.accuracy.position_rad", "Replay to the end position, at most [rad]", precise, "empty: 0.001; degree and grid are chosen so that it holds"),
  );
  const asItIsPart = h(
    "div",
    { class: "fields" },
    field("transcription.scheme", "Scheme", scheme),
    field("transcription.degree", "Degree", degree),
    field("transcription.intervals", "Intervals", intervals),
    field("transcription.control", "Control", control),
  );

  function showParts() {
    alphaField.hidden = objective.value !== "weighted";
    gridPart.hidden = kindOfTasks !== "grid";
    list.element.hidden = kindOfTasks !== "list";
    accuracyPart.hidden = kindOfGrid !== "accuracy";
    asItIsPart.hidden = kindOfGrid !== "as_it_is";
  }

  function transcription() {
    if (kindOfGrid === "preset") return { preset: "paper" };
    if (kindOfGrid === "accuracy") {
      const asked = given({ position_rad: oneNumber(precise.value) });
      return Object.keys(asked).length ? { accuracy: asked } : undefined;
    }
    return given({ scheme: scheme.value, degree: oneNumber(degree.value), intervals: oneNumber(intervals.value), control: control.value });
  }

  function value() {
    const constants = given(Object.fromEntries(Object.entries(motor).map(([key, input]) => [key, oneNumber(input.value)])));
    const others = compare.filter((box) => box.checked && box.value !== method.value).map((box) => box.value);
    const labels = tags.value.split(",").map((tag) => tag.trim()).filter(Boolean);
    const grid = given({ stroke: manyNumbers(stroke.value), payload_kg: manyNumbers(payload.value), duration_s: oneNumber(duration.value) });
    return given({
      name: name.value.trim() || undefined,
      robot: robot.value,
      objective: given({ kind: objective.value, alpha: objective.value === "weighted" ? oneNumber(alpha.value) : undefined }),
      tasks: kindOfTasks === "grid" ? { grid } : list.value(),
      motor: Object.keys(constants).length ? constants : undefined,
      transcription: transcription(),
      method: method.value,
      compare: others.length ? others : undefined,
      empirical_task: indexOrName(empirical.value),
      worst_case_task: indexOrName(worst.value),
      tags: labels.length ? labels : undefined,
    });
  }

  const pickTasks = (kind) => {
    kindOfTasks = kind;
    for (const box of compare) box.checked = kind === "grid" && COMPARED.includes(box.value); // a list has no middle
    showParts();
  };
  const pickGrid = (kind) => {
    kindOfGrid = kind;
    showParts();
  };
  const element = h(
    "div",
    { class: "form" },
    section("Application", h("div", { class: "fields" }, field("name", "Name", name), field("robot", "Robot", robot), field("tags", "Tags", tags, "separated by commas")), null),
    upload,
    section("Objective", h("div", { class: "fields" }, field("objective.kind", "Minimise", objective), alphaField), null),
    section("Tasks", [gridPart, list.element], choice("Form of the tasks", [["grid", "grid"], ["list", "list"]], "grid", pickTasks)),
    section(
      "Method",
      [
        h("div", { class: "fields" }, field("method", "One design by", method), field("empirical_task", "Empirical: task", empirical, "index or name; a grid has its middle"), field("worst_case_task", "Worst case: task", worst, "index or name; a grid has its last")),
        h("fieldset", { class: "checks" }, h("legend", {}, "Compare with"), compare.map((box) => h("label", {}, box, " ", methodName(box.value)))),
      ],
      null,
    ),
    section(
      "Accuracy",
      [accuracyPart, asItIsPart],
      choice("How accurate", [["accuracy", "to an accuracy"], ["preset", "the paper's grid"], ["as_it_is", "a grid of mine"]], "accuracy", pickGrid),
    ),
    h(
      "details",
      { class: "card" },
      h("summary", {}, "Motors: limits and winding"),
      h("div", { class: "fields" }, Object.entries(motor).map(([key, input]) => field(`motor.${key}`, motorLabel(key), input, "empty: the paper's"))),
      h("p", { class: "hint" }, "Bounds of the seven lengths and all other constants: as YAML."),
    ),
  );
  showParts();
  return { element, value };
}

function section(title, content, switcher) {
  return h("section", { class: "card", "aria-label": title }, h("header", {}, h("h2", {}, title), switcher), content);
}

function motorLabel(key) {
  const [, name, unit] = /^(.*)_(A|V|kg)$/.exec(key) ?? [null, key, ""];
  return `${words(name)}${unit ? ` [${unit}]` : ""}`;
}
