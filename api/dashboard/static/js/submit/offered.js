/** What this server offers, from its own description; the paper's choices when it cannot be read. */

import { get } from "../api.js";

export async function offered(signal) {
  const [description, robots] = await Promise.all([
    get("/v1/openapi.json", signal).catch(() => null),
    get("/v1/robots", signal),
  ]);
  const schemas = description?.components?.schemas ?? {};
  const choices = (schema, property) => schemas[schema]?.properties?.[property]?.enum;
  return {
    objectives: choices("ObjectiveRequest", "kind") ?? ["time", "energy", "weighted"],
    // A catalogue's sizes come with a file: the form has no fields for them.
    methods: (choices("ApplicationRequest", "method") ?? ["two_step", "empirical", "worst_case"]).filter((m) => m !== "catalogue"),
    robots: robots.items,
  };
}
