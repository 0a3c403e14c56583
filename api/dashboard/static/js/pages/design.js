/** The design: every motor to scale, its lengths, parameters and limits. */

import { get, getIfThere, ofApplication } from "../api.js";
import { h, replace } from "../dom.js";
import { methodName } from "../format.js";
import { dimensioned } from "../motor/dimensioned.js";
import { motorSection } from "../motor/section.js";
import { choice } from "../parts/choice.js";
import { head } from "../parts/head.js";
import { motorCards } from "../parts/motor-cards.js";
import { constraintTable, dimensionTable, parameterTable } from "../parts/motor-sheet.js";
import { designSought, whenChanged } from "../parts/when-changed.js";
import { rememberQuery } from "../router.js";

const MATERIALS = [
  ["stator", "stator iron"],
  ["copper", "winding"],
  ["north", "magnet, north"],
  ["south", "magnet, south"],
  ["rotor", "rotor iron"],
];

export async function show(at, signal) {
  const { id } = at.params;
  const [first, resolved] = await Promise.all(
    ["", "/resolved"].map((rest) => get(ofApplication(id, rest), signal)),
  );
  let status = first;
  const content = h("div", { class: "page" });
  let method = status.methods.includes(at.query.get("method")) ? at.query.get("method") : status.method;
  let motor = Math.max(0, Number(at.query.get("motor") ?? 1) - 1);

  async function update() {
    rememberQuery({ method: method === status.method ? null : method, motor: motor > 0 ? motor + 1 : null });
    const design = !designSought(status, method) ? null : await getIfThere(ofApplication(id, `/design?method=${encodeURIComponent(method)}`), signal);
    replace(content, design === null ? h("p", { class: "empty" }, missing(status, method)) : motors(design));
  }

  function motors(design) {
    const sections = design.motors.map((sheet) => motorSection(sheet.dimensions_mm, resolved.motor));
    const chosen = Math.min(motor, design.motors.length - 1);
    const large = h("section", { class: "card", "aria-live": "polite" });
    const pick = (k) => {
      motor = k;
      rememberQuery({ method: method === status.method ? null : method, motor: k > 0 ? k + 1 : null });
      replace(large, detail(design.motors[k], sections[k], resolved));
    };
    pick(chosen);
    return [motorCards(sections, design.motors, chosen, pick), materials(resolved.motor), large];
  }

  const switcher = choice(
    "Design of which method",
    status.methods.map((name) => [name, methodName(name)]),
    method,
    (value) => {
      method = value;
      update();
    },
  );
  await update();
  const top = head(status, "/design");
  whenChanged(status, signal, async (next) => {
    const nowThere = !designSought(status, method) && designSought(next, method);
    status = next;
    top.setState(next.state);
    if (nowThere) await update();
  });
  const element = h(
    "div",
    { class: "page" },
    top.element,
    h("div", { class: "head-line" }, h("h2", {}, "Motors, all to one scale"), status.methods.length > 1 ? switcher : null),
    content,
  );
  return { title: `Design of ${status.name}`, element };
}

function detail(sheet, section, resolved) {
  const binding = sheet.binding.length;
  const title = `Motor ${sheet.joint}, across and along its axis, with its seven lengths`;
  return [
    h(
      "header",
      {},
      h("h2", {}, `Motor ${sheet.joint}`),
      h("p", { class: "about" }, binding === 0 ? "no limit binds" : `${binding} limit${binding === 1 ? "" : "s"} bind`),
    ),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Drawing" }, dimensioned(section, sheet.dimensions_mm, title)),
    h(
      "div",
      { class: "columns tables" },
      h("div", {}, h("h3", {}, "Dimensions"), dimensionTable(sheet, resolved.motor.bounds_mm)),
      h("div", {}, h("h3", {}, "Constraints"), constraintTable(sheet), h("h3", { class: "below" }, "Parameters"), parameterTable(sheet)),
    ),
  ];
}

function materials(motor) {
  return h(
    "ul",
    { class: "key" },
    MATERIALS.map(([kind, text]) => h("li", {}, h("span", { class: `swatch ${kind}`, "aria-hidden": "true" }), text)),
    h("li", {}, `${motor.slots} slots, ${2 * motor.pole_pairs} poles; shaft and end windings are not drawn`),
  );
}

function missing(status, method) {
  const open = ["queued", "running"].includes(status.state);
  const name = methodName(method);
  return open ? `The ${name} design comes when all tasks have their own.` : `There is no ${name} design.`;
}
