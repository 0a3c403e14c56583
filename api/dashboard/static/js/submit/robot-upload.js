/** A robot from a file: a URDF with its gear ratio, or the robot format as JSON or YAML. */

import { announce } from "../announce.js";
import { uploadRobot } from "../api.js";
import { h, replace } from "../dom.js";
import { field } from "./field.js";
import { oneNumber } from "./numbers.js";

/**
 * @param {(robot: {id: string, name: string}) => void} uploaded called with what the server keeps from now on
 * @returns {HTMLElement}
 */
export function robotUpload(uploaded) {
  const file = h("input", { type: "file", accept: ".urdf,.xml,.json,.yaml,.yml" });
  const gear = h("input", { type: "text", value: "100", inputmode: "decimal", autocomplete: "off" });
  const said = h("div");
  const button = h("button", { type: "button", class: "quiet", on: { click: send } }, "Upload");

  async function send() {
    replace(said);
    const chosen = file.files[0];
    if (!chosen) {
      replace(said, refusal(["choose a file first"]));
      file.focus();
      return;
    }
    button.disabled = true;
    try {
      const text = await chosen.text();
      const urdf = text.trimStart().startsWith("<");
      const { id } = await uploadRobot(urdf ? JSON.stringify({ urdf: text, gear_ratio: oneNumber(gear.value) }) : text);
      uploaded({ id, name: chosen.name.replace(/\.\w+$/, "") });
      announce("Robot uploaded");
      replace(said, h("p", { class: "hint", role: "status" }, `kept as ${id}, and chosen above`));
    } catch (error) {
      replace(said, refusal(error.errors?.length ? error.errors.map((e) => e.message) : [error.message]));
    } finally {
      button.disabled = false;
    }
  }

  return h(
    "details",
    { class: "card" },
    h("summary", {}, "A robot of my own"),
    h(
      "div",
      { class: "fields" },
      field("robot_file", "File", file, "a URDF, or the robot format as JSON or YAML"),
      field("robot_gear_ratio", "Gear ratio of every joint", gear, "for a URDF, which has none"),
    ),
    h("p", {}, button),
    said,
  );
}

function refusal(messages) {
  return h("div", { class: "notice bad", role: "alert" }, "Not uploaded:", h("ul", {}, messages.map((m) => h("li", {}, m))));
}
