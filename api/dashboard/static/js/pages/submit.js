/** Submit an application, from a form or from YAML. What is wrong is shown where it is. */

import { announce } from "../announce.js";
import { Problem, submit } from "../api.js";
import { h, replace } from "../dom.js";
import { count } from "../format.js";
import { choice } from "../parts/choice.js";
import { failure } from "../parts/failure.js";
import { applicationLink, rememberQuery } from "../router.js";
import { editor } from "../submit/editor.js";
import { clearErrors, placeErrors } from "../submit/field.js";
import { applicationForm } from "../submit/form.js";
import { offered } from "../submit/offered.js";
import { toYaml } from "../submit/yaml.js";

export async function show(at, signal) {
  const form = applicationForm(await offered(signal));
  const text = editor();
  const summary = h("div");
  const switcher = h("div");
  const asYaml = h("button", { type: "button", class: "quiet", on: { click: copyToEditor } }, "Go on as YAML");
  const button = h("button", { type: "submit" }, "Submit");
  let kind = at.query.get("as") === "yaml" ? "yaml" : "form";
  let sent = { text: "", key: "" };

  function showKind() {
    form.element.hidden = kind !== "form";
    text.element.hidden = kind !== "yaml";
    asYaml.hidden = kind !== "form";
    replace(switcher, choice("How to submit", [["form", "Form"], ["yaml", "YAML or JSON"]], kind, pick));
  }

  function pick(next) {
    kind = next;
    rememberQuery({ as: kind === "yaml" ? "yaml" : null });
    replace(summary);
    showKind();
  }

  function copyToEditor() {
    text.fill(toYaml(form.value()));
    text.clear();
    pick("yaml");
  }

  async function send(event) {
    event.preventDefault();
    clearErrors(form.element);
    text.clear();
    replace(summary);
    const content = kind === "form" ? JSON.stringify(form.value()) : text.value();
    if (content !== sent.text) sent = { text: content, key: newKey() }; // a second click sends the same again
    button.disabled = true;
    try {
      const accepted = await submit(content, sent.key);
      announce("Application submitted");
      location.hash = applicationLink(accepted.id);
    } catch (error) {
      refused(error);
    } finally {
      button.disabled = false;
    }
  }

  function refused(error) {
    if (!(error instanceof Problem)) replace(summary, failure(error));
    else if (kind === "yaml") {
      replace(summary, error.errors.length ? h("div", { class: "notice bad", role: "alert" }, toChange(error.errors.length)) : failure(error));
      text.show(error.errors, error.message);
    } else atFields(error);
  }

  function atFields(problem) {
    if (problem.errors.length === 0) {
      replace(summary, failure(problem));
      return;
    }
    const placed = placeErrors(form.element, problem.errors);
    const entry = ({ error, input }) => h("li", {}, input ? h("a", { href: `#${input.id}`, on: { click: (e) => (e.preventDefault(), input.focus()) } }, error.message) : error.message);
    replace(
      summary,
      h("div", { class: "notice bad", role: "alert" }, toChange(placed.length), h("ul", {}, placed.map(entry))),
    );
    (placed.find(({ input }) => input)?.input ?? button).focus();
  }

  showKind();
  const element = h(
    "form",
    { class: "page", novalidate: true, on: { submit: send } },
    h("div", { class: "head-line" }, h("h1", {}, "New application"), switcher),
    summary,
    form.element,
    text.element,
    h("div", { class: "buttons" }, button, asYaml),
  );
  return { title: "New application", element };
}

const toChange = (n) => h("strong", {}, `Not submitted: ${count(n, "thing")} to change`);

/** randomUUID needs https; this does not. */
function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
