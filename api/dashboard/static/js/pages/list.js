/** The applications: newest first, filtered, a page at a time, kept up to date while it is looked at. */

import { announce } from "../announce.js";
import { forEachFew, get, ofApplication, post, remove } from "../api.js";
import { h, replace } from "../dom.js";
import { count, isFinal, stateName } from "../format.js";
import { ask } from "../parts/ask.js";
import { listRow } from "../parts/list-row.js";
import { failure } from "../parts/failure.js";
import { repeat } from "../repeat.js";
import { link } from "../router.js";

const PAGE = 50;
const EVERY_MS = 2500;
const STATES = ["queued", "running", "succeeded", "completed_with_failures", "failed", "cancelled"];

export async function show(at, signal) {
  const query = Object.fromEntries(at.query);
  const rows = new Map();
  const picked = new Set();
  const body = h("tbody");
  const bulk = h("div", { class: "bulk" });
  const paging = h("nav", { class: "paging", "aria-label": "Pages" });
  const trouble = h("div");
  const all = h("input", { type: "checkbox", "aria-label": "Pick all on this page", on: { change: pickAll } });
  const queue = h("p", { class: "about" });

  function pickAll() {
    const yes = all.checked; // picking the first of many changes it
    for (const id of rows.keys()) pick(id, yes);
  }

  function pick(id, yes) {
    if (yes) picked.add(id);
    else picked.delete(id);
    rows.get(id)?.setPicked(yes);
    showBulk();
  }

  function showBulk() {
    const some = picked.size > 0;
    all.checked = some && picked.size === rows.size;
    all.indeterminate = some && picked.size < rows.size;
    const open = [...picked].filter((id) => rows.has(id) && !isFinal(rows.get(id).item.state));
    replace(
      bulk,
      some ? `${count(picked.size, "application")} picked` : "Pick applications to cancel or delete them together.",
      some && open.length > 0
        ? h("button", { type: "button", class: "quiet", on: { click: () => cancelAll(open) } }, `Cancel ${open.length}`)
        : null,
      some
        ? h("button", { type: "button", class: "danger", on: { click: deleteAll } }, `Delete ${picked.size}`)
        : null,
    );
  }

  async function cancelAll(ids) {
    await together(ids, (id) => post(ofApplication(id, "/cancel")), "cancelled");
  }

  async function deleteAll() {
    const ids = [...picked];
    const question = `Delete ${count(ids.length, "application")} with all results? This cannot be undone.`;
    if (await ask(question, `Delete ${ids.length}`)) await together(ids, (id) => remove(ofApplication(id)), "deleted");
  }

  async function together(ids, act, done) {
    const errors = await forEachFew(ids, act);
    for (const id of ids) pick(id, false);
    replace(trouble, errors.length ? failure(errors[0]) : null);
    announce(`${count(ids.length - errors.length, "application")} ${done}`);
    await refresh();
  }

  async function refresh() {
    const parameters = new URLSearchParams({ limit: PAGE, ...query });
    const page = await get(`/v1/applications?${parameters}`, signal);
    update(page.items);
    replace(
      paging,
      query.cursor ? h("a", { class: "button quiet", href: link("/", { ...query, cursor: null }) }, "Newest") : null,
      page.next_cursor
        ? h("a", { class: "button quiet", href: link("/", { ...query, cursor: page.next_cursor }) }, "Older →")
        : null,
    );
    showBulk();
  }

  function update(items) {
    const there = new Set(items.map((item) => item.id));
    for (const [id, row] of rows) {
      if (there.has(id)) continue;
      row.element.remove();
      rows.delete(id);
      picked.delete(id);
    }
    body.querySelector(".empty-row")?.remove();
    items.forEach((item, k) => {
      let row = rows.get(item.id);
      if (row === undefined) {
        row = listRow(item, pick);
        rows.set(item.id, row);
      }
      row.update(item);
      if (body.children[k] !== row.element) body.insertBefore(row.element, body.children[k] ?? null);
    });
    if (items.length === 0) body.append(emptyRow(query));
  }

  async function showQueue() {
    const ready = await get("/readyz", signal).catch((error) => ({ trouble: error }));
    if (ready.queued_jobs === undefined) replace(queue, "The service is not ready to take work.");
    else replace(queue, `${count(ready.running_jobs, "solve")} running, ${ready.queued_jobs} waiting`);
  }

  await refresh();
  repeat(refresh, EVERY_MS, signal);
  showQueue();
  repeat(showQueue, 2 * EVERY_MS, signal);

  const element = h(
    "div",
    { class: "page" },
    h(
      "div",
      { class: "head-line" },
      h("h1", {}, "Applications"),
      queue,
      h("div", { class: "buttons" }, h("a", { class: "button", href: "#/submit" }, "New application")),
    ),
    filters(query),
    h(
      "section",
      { class: "card", "aria-label": "Applications" },
      bulk,
      trouble,
      h(
        "table",
        { class: "records list" },
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            h("td", {}, all),
            ["Name", "State", "Progress", "Best total", "Created"].map((text) =>
              h("th", { scope: "col", class: text === "Best total" ? "figure" : null }, text),
            ),
          ),
        ),
        body,
      ),
      paging,
    ),
  );
  return { title: "Applications", element };
}

function filters(query) {
  const go = (changes) => {
    const next = link("/", { ...query, cursor: null, ...changes });
    if (location.hash !== next) location.hash = next;
  };
  const name = h("input", { type: "search", name: "name", value: query.name ?? "", maxlength: 200 });
  const tag = h("input", { type: "search", name: "tag", value: query.tag ?? "", maxlength: 200 });
  const state = h(
    "select",
    { name: "state", on: { change: () => go({ state: state.value }) } },
    h("option", { value: "" }, "any"),
    STATES.map((value) => h("option", { value, selected: value === query.state }, stateName(value))),
  );
  const search = (event) => {
    event.preventDefault();
    go({ name: name.value.trim(), tag: tag.value.trim(), state: state.value });
  };
  return h(
    "form",
    { class: "filters", role: "search", on: { submit: search } },
    h("label", { class: "grow" }, "Name contains", name),
    h("label", {}, "State", state),
    h("label", {}, "Tag", tag),
    h("button", { type: "submit", class: "quiet" }, "Search"),
    Object.keys(query).length ? h("a", { href: "#/" }, "Clear") : null,
  );
}

function emptyRow(query) {
  const filtered = Object.keys(query).length > 0;
  return h(
    "tr",
    { class: "empty-row" },
    h(
      "td",
      { colspan: 6, class: "empty" },
      filtered ? "No application matches." : ["Nothing here yet. ", h("a", { href: "#/submit" }, "Submit the first one.")],
    ),
  );
}
