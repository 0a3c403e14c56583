/** A task: its motion against the limits, the arm in three dimensions, its certificate, and how the solver got there. */

import { get, getIfThere, ofApplication } from "../api.js";
import { player } from "../arm/player.js";
import { armView } from "../arm/view.js";
import { h, replace } from "../dom.js";
import { duration, methodName, number, quantity } from "../format.js";
import { DIMENSIONS } from "../names.js";
import { certificateView } from "../parts/certificate.js";
import { choice } from "../parts/choice.js";
import { solverLog } from "../parts/solver-log.js";
import { stateBadge } from "../parts/state.js";
import { useOfLimits } from "../parts/use-of-limits.js";
import { whenChanged } from "../parts/when-changed.js";
import { motionRows, valueAt } from "../plots/motion-rows.js";
import { panel } from "../plots/panel.js";
import { applicationLink, rememberQuery } from "../router.js";

const NARROW = "(max-width: 62rem)";

export async function show(at, signal) {
  const { id, task: index } = at.params;
  const read = (rest) => get(ofApplication(id, rest), signal);
  const [status, resolved, first] = await Promise.all(["", "/resolved", `/tasks/${index}`].map(read));
  let task = first;
  const content = h("div", { class: "page" });
  const methods = ["own", ...status.methods];
  let method = at.query.get("method");
  if (!methods.includes(method)) method = task.methods[status.method] ? status.method : "own";
  let leaving = new AbortController();
  signal.addEventListener("abort", () => leaving.abort());
  const resultOf = (name) => (name === "own" ? task.own : task.methods[name]);

  async function update() {
    leaving.abort();
    leaving = new AbortController();
    const mine = leaving.signal;
    rememberQuery({ method });
    const result = resultOf(method);
    const asked = (what) => getIfThere(ofApplication(id, `/tasks/${index}/${what}?method=${encodeURIComponent(method)}`), mine);
    const [motion, log] = await Promise.all([
      result ? asked("trajectory") : null,
      result || ["failed", "cancelled"].includes(task.state) ? asked("log") : null,
    ]);
    if (mine.aborted) return;
    replace(
      content,
      motion ? moving(motion, result, resolved, task, mine) : h("p", { class: "notice" }, why(task, method)),
      h(
        "div",
        { class: "columns tables" },
        result ? h("section", { class: "card" }, h("h2", {}, "Certificate"), certificateView(result.certificate)) : null,
        h("section", { class: "card" }, h("h2", {}, "Solver"), solverLog(log)),
      ),
    );
  }

  await update();
  whenChanged(status, signal, async () => {
    const had = resultOf(method);
    task = await read(`/tasks/${index}`);
    if (!had) await update();
  });
  const element = h("div", { class: "page" }, header(status, task, resolved), h("div", { class: "head-line" }, switcher()), content);

  function switcher() {
    return choice(
      "Motion with which design",
      methods.map((name) => [name, methodName(name)]),
      method,
      (value) => {
        method = value;
        update();
      },
    );
  }

  return { title: `${task.name}, ${status.name}`, element };
}

function header(status, task, resolved) {
  const neighbour = (k, text) =>
    k >= 0 && k < resolved.tasks.length
      ? h("a", { class: "button quiet", href: applicationLink(status.id, `/tasks/${k}`), "aria-label": `${text} task` }, text)
      : null;
  return h(
    "header",
    { class: "head" },
    h("p", { class: "crumbs" }, h("a", { href: "#/" }, "Applications"), " / ", h("a", { href: applicationLink(status.id) }, status.name), " / "),
    h(
      "div",
      { class: "head-line" },
      h("h1", {}, task.name),
      stateBadge(task.state),
      h("div", { class: "buttons" }, neighbour(task.index - 1, "← Previous"), neighbour(task.index + 1, "Next →")),
    ),
    h("p", { class: "about" }, `task ${task.index} · payload ${quantity(task.payload_kg, "kg")} · weight ${task.weight}`),
    task.reason ? h("p", { class: "notice" }, task.reason) : null,
  );
}

function moving(motion, result, resolved, task, signal) {
  const end = motion.time_s.at(-1);
  const joints = motion.joint_position_rad[0].length;
  const motors = motion.design_mm.map((row) => Object.fromEntries(DIMENSIONS.map((name, k) => [name, row[k]])));
  const arm = armView(resolved.robot, motors, motion.joint_position_rad, task.payload_kg, signal);
  const rows = motionRows(motion, result, resolved);
  let panels = [];
  const positions = rows[0].curves[0].points;
  const play = player(end, showTime, signal);
  const grid = h("div", { class: "motion-grid" });

  function showTime(time) {
    arm.draw(positions.map((points) => valueAt(points, time)));
    for (const one of panels) one.at(time);
  }

  function drawPanels(choose) {
    const large = choose !== "all";
    const shown = large ? [Number(choose)] : Array.from({ length: joints }, (_, k) => k);
    grid.className = large ? "motion-grid one" : "motion-grid";
    grid.style.setProperty("--columns", String(joints));
    panels = rows.flatMap((row) => shown.map((joint) => panel(row, joint, end, { large, seek: play.seek })));
    const heads = large ? [] : shown.map((joint) => h("h3", {}, `Joint ${joint + 1}`));
    replace(grid, heads, panels.map((one) => one.element));
  }

  const first = matchMedia(NARROW).matches ? "0" : "all";
  drawPanels(first);
  play.start();
  const joint = choice(
    "Joint",
    [["all", "all joints"], ...Array.from({ length: joints }, (_, k) => [String(k), String(k + 1)])],
    first,
    (value) => {
      drawPanels(value);
      play.start();
    },
  );
  return [
    h(
      "div",
      { class: "columns wide-first" },
      h("section", { class: "card", "aria-label": "The arm" }, arm.canvas, play.element, h("p", { class: "hint" }, "Motors to scale; links have no shape in the model. Dashed: start and end. Floor grid 0.1 m. Drag to turn.")),
      h(
        "div",
        { class: "page" },
        h("section", { class: "card" }, h("h2", {}, "Result"), resultFacts(result)),
        result ? h("section", { class: "card" }, h("h2", {}, "Peaks, % of the limits"), useOfLimits(result.peaks), missed(result.certificate)) : null,
      ),
    ),
    h(
      "section",
      { class: "card" },
      h("header", {}, h("h2", {}, "Motion against its limits"), joint),
      legend(rows),
      h("div", { class: "scroll" }, grid),
    ),
  ];
}

/** Why a motion may lie beyond its limits: they are kept at the grid's points, and the replay looks between them too. */
function missed(certificate) {
  if (certificate.within_tolerance !== false) return null;
  return h("p", { class: "hint" }, "Of the replay, between the grid's points too, which this motion's grid is too coarse for: see the certificate.");
}

function resultFacts(result) {
  if (!result) return h("p", { class: "empty" }, "No figures.");
  const lines = [
    ["Time of the motion", quantity(result.final_time_s, "s")],
    ["Energy ∫u'u", quantity(result.energy_V2s, "V2 s")],
    ["Electrical energy", quantity(result.electrical_energy_J, "J")],
    ["Copper loss", quantity(result.copper_loss_J, "J")],
    ["Given back", quantity(result.recovered_energy_J.reduce((sum, x) => sum + x, 0), "J")],
    ["Solver", `${result.iterations} iterations, ${duration(result.solve_time_s)}`],
    ...startFacts(result.starts),
  ];
  return h("dl", { class: "facts" }, lines.map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)]));
}

/** What several starts found; nothing where there was one. */
function startFacts(starts) {
  if (!starts) return [];
  const [best, worst] = [starts.ends[0], starts.ends.at(-1)];
  const spread = worst.objective === best.objective ? 0 : (worst.objective - best.objective) / Math.abs(best.objective);
  return [
    ["Starts", `${starts.solved} of ${starts.runs.length} solved, ${best.starts} at the best optimum`],
    ["Spread of the optima", `${number(100 * spread, 3)} %`],
  ];
}

function legend(rows) {
  const units = rows.map((row) => `${row.label} [${row.unit}]`).join(", ");
  const line = (kind, text) => h("li", {}, h("span", { class: `line-sign ${kind}`, "aria-hidden": "true" }), text);
  return h("ul", { class: "key" }, line("first", "value, or q axis"), line("second", "d axis"), line("limit", "limit"), h("li", {}, units));
}

function why(task, method) {
  if (task.reason) return `No motion with ${methodName(method)}: ${task.reason}`;
  return `There is no motion with ${methodName(method)} yet.`;
}
