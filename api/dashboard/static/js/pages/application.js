/** An application, live: its tasks fill in as they finish. */

import { announce } from "../announce.js";
import { get, ofApplication } from "../api.js";
import { h, replace } from "../dom.js";
import { count, duration, isFinal, methodName, moment, quantity, stageName, stateName, unit } from "../format.js";
import { follow, soon } from "../live.js";
import { showActions } from "../parts/actions.js";
import { choice } from "../parts/choice.js";
import { failure } from "../parts/failure.js";
import { head } from "../parts/head.js";
import { stageList } from "../parts/stages.js";
import { range, taskGrid } from "../parts/task-grid.js";
import { repeat } from "../repeat.js";
import { applicationLink, rememberQuery } from "../router.js";

const REFRESH_MS = 400;
const FALLBACK_MS = 5000;
const MOST_FAILURES = 50;

export async function show(at, signal) {
  const { id } = at.params;
  const read = () =>
    Promise.all([get(ofApplication(id), signal), get(ofApplication(id, "/overview"), signal)]);
  let [status, overview] = await read();
  let wanted = at.query.get("method");
  let following = null;
  const iterations = new Map();

  const top = head(status, "");
  const grid = taskGrid(overview);
  const stages = stageList(status.progress.stages);
  const trouble = h("div");
  const switcher = h("div", { class: "switch" });
  const key = h("p", { class: "scale-key" });
  const facts = h("dl", { class: "facts" });
  const workers = h("ul", { class: "reasons" });
  const failures = h("section", { class: "card" });
  const reason = h("div");

  const method = () => {
    if (wanted !== null) return wanted;
    const moved = overview.tasks.some((task) => Number.isFinite(task.outcomes[status.method]?.value));
    return moved ? status.method : "own";
  };

  function update() {
    const shown = method();
    top.setState(status.state);
    showActions(top.buttons, status, { changed: refreshSoon, failed: (error) => replace(trouble, failure(error)) });
    grid.update(overview, shown, iterations);
    stages.update(status.progress.stages);
    showSwitch(shown);
    showKey(key, range(overview, shown), status.objective.kind);
    showFacts(facts, status);
    showWorkers(workers, overview, status);
    showFailures(failures, overview);
    replace(reason, status.reason ? h("p", { class: "notice" }, status.reason) : null);
  }

  function showSwitch(shown) {
    if (switcher.dataset.shown === shown) return;
    switcher.dataset.shown = shown;
    const options = ["own", ...overview.methods].map((name) => [name, methodName(name)]);
    const choose = (value) => {
      wanted = value;
      rememberQuery({ method: value });
      update();
    };
    replace(switcher, choice("Values of which design", options, shown, choose));
  }

  async function refresh() {
    [status, overview] = await read();
    update();
    if (isFinal(status.state)) iterations.clear();
    else watch();
  }
  const refreshSoon = soon(refresh, Math.max(REFRESH_MS, overview.tasks.length)); // 2,000 tasks: every 2 s

  function react(kind, content) {
    if (kind === "iteration") {
      iterations.set(`${content.method || "own"}/${content.task_index}`, content.iteration);
      grid.update(overview, method(), iterations);
      return;
    }
    if (kind === "stage") announce(`Stage ${stageName(content.stage)} begins, ${count(content.jobs, "job")}`);
    if (kind === "application" && isFinal(content.state)) announce(`${status.name}: ${stateName(content.state)}`);
    refreshSoon();
  }

  /** Follow the events while there are any; after a retry, again. */
  function watch() {
    if (following !== null && !following.signal.aborted) return;
    following = new AbortController();
    const ends = following;
    signal.addEventListener("abort", () => ends.abort());
    const heard = (kind, content) => {
      if (kind === "application" && isFinal(content.state)) ends.abort();
      react(kind, content);
    };
    follow(id, overview.last_event, heard, ends.signal);
  }

  update();
  if (!isFinal(status.state)) watch();
  repeat(async () => (isFinal(status.state) ? undefined : refresh()), FALLBACK_MS, signal);

  const element = h(
    "div",
    { class: "page" },
    top.element,
    trouble,
    reason,
    h(
      "div",
      { class: "columns wide-first" },
      h(
        "section",
        { class: "card", "aria-label": "Tasks" },
        h("header", {}, h("h2", {}, count(overview.tasks.length, "task")), switcher),
        grid.element,
        key,
      ),
      h(
        "div",
        { class: "page" },
        h("section", { class: "card" }, h("h2", {}, "Stages"), stages.element, facts),
        h("section", { class: "card" }, h("h2", {}, "Running now"), workers),
      ),
    ),
    failures,
  );
  return { title: status.name, element };
}

function showKey(key, scale, objective) {
  const what = { time: "time of the motion", energy: "energy, the integral of u'u", weighted: "weighted objective", electrical_energy: "electrical energy" }[objective];
  if (!Number.isFinite(scale.low)) {
    replace(key, "No value yet.");
    return;
  }
  const bare = unit(scale.unit);
  replace(
    key,
    `${what}${bare ? ` [${bare}]` : ""}`,
    h("span", {}, quantity(scale.low, scale.unit)),
    h("span", { class: "ramp", "aria-hidden": "true" }),
    h("span", {}, quantity(scale.high, scale.unit)),
  );
}

function showFacts(facts, status) {
  const { progress, timings } = status;
  const ended = isFinal(status.state);
  const left = progress.compiling
    ? "compiling derivatives, once for this machine"
    : progress.eta_s === null
      ? "not known yet"
      : `about ${duration(progress.eta_s)}`;
  const lines = [
    ["Jobs", `${progress.done} of ${progress.total}`],
    ended ? ["Wall time", duration(timings.wall_time_s)] : ["Time left", left],
    ["Solver time", duration(timings.solver_time_s)],
    ["Created", moment(status.created_at)],
    status.finished_at ? ["Finished", moment(status.finished_at)] : null,
    progress.best ? ["Best task", `${quantity(progress.best.value, progress.best.unit)}, ${progress.best.task}`] : null,
  ];
  replace(facts, lines.filter(Boolean).map(([term, value]) => [h("dt", {}, term), h("dd", {}, value)]));
}

function showWorkers(list, overview, status) {
  const names = (job) => (job.task_index < 0 ? "all designs" : (overview.tasks[job.task_index]?.name ?? ""));
  const idle = isFinal(status.state) ? "Nothing: it has ended." : "Nothing at this moment.";
  replace(
    list,
    overview.running.length === 0 ? h("li", { class: "empty" }, idle) : null,
    overview.running.map((job) =>
      h(
        "li",
        {},
        h("strong", {}, `${stageName(job.stage)}: ${names(job)}`),
        job.method === "own" ? "" : ` (${methodName(job.method)})`,
        h("div", { class: "hint" }, `${job.worker ?? "a worker"}, for ${duration(job.for_s)}`),
      ),
    ),
  );
}

/** Tasks that the application went on without, and motions that could not be found. */
function showFailures(section, overview) {
  const failed = overview.tasks.flatMap((task) =>
    Object.entries(task.outcomes)
      .filter(([, outcome]) => ["failed", "dead"].includes(outcome.state))
      .map(([method, outcome]) => ({ task, method, outcome })),
  );
  const shown = failed.slice(0, MOST_FAILURES);
  section.hidden = failed.length === 0;
  replace(
    section,
    h("h2", {}, `Not solved: ${count(failed.length, "solve")}`),
    h(
      "ul",
      { class: "reasons" },
      shown.map(({ task, method, outcome }) =>
        h(
          "li",
          {},
          h("a", { href: applicationLink(overview.application_id, `/tasks/${task.index}`, { method }) }, task.name),
          method === "own" ? h("strong", {}, " left out of the design: ") : ` with the ${methodName(method)} design: `,
          outcome.reason ?? "its worker was lost three times",
        ),
      ),
      failed.length > shown.length ? h("li", { class: "hint" }, `and ${failed.length - shown.length} more`) : null,
    ),
  );
}
