/** The stages of an application, each with a bar. */

import { h } from "../dom.js";
import { stageName } from "../format.js";
import { progressBar } from "./progress.js";

/** @param {any[]} stages of the status */
export function stageList(stages) {
  const lines = stages.map((stage) => {
    const bar = progressBar(stageName(stage.name));
    const text = h("span", { class: "hint" });
    const element = h(
      "li",
      {},
      h("div", { class: "stage-line" }, h("span", {}, stageName(stage.name)), text),
      bar.element,
    );
    return { element, bar, text };
  });
  return {
    element: h("ol", { class: "stages" }, lines.map((line) => line.element)),
    update(next) {
      next.forEach((stage, k) => {
        const bad = stage.failed + stage.dead + stage.cancelled;
        lines[k].bar.update(stage.succeeded + bad, stage.total, bad);
        const more = [
          stage.running ? `${stage.running} running` : "",
          stage.failed ? `${stage.failed} failed` : "",
          stage.dead ? `${stage.dead} lost` : "",
          stage.cancelled ? `${stage.cancelled} cancelled` : "",
        ].filter(Boolean);
        lines[k].text.textContent = [`${stage.succeeded} of ${stage.total}`, ...more].join(", ");
      });
    },
  };
}
