/** Addresses are fragments: `#/applications/ID/design?method=own`. Back and forward work by themselves. */

const ROUTES = [
  [/^\/$/, "applications", () => import("./pages/list.js")],
  [/^\/applications\/(?<id>[^/]+)$/, "applications", () => import("./pages/application.js")],
  [/^\/applications\/(?<id>[^/]+)\/design$/, "applications", () => import("./pages/design.js")],
  [/^\/applications\/(?<id>[^/]+)\/designs$/, "applications", () => import("./pages/designs.js")],
  [/^\/applications\/(?<id>[^/]+)\/comparison$/, "applications", () => import("./pages/comparison.js")],
  [/^\/applications\/(?<id>[^/]+)\/tasks\/(?<task>\d+)$/, "applications", () => import("./pages/task.js")],
  [/^\/compare$/, "compare", () => import("./pages/compare.js")],
  [/^\/submit$/, "submit", () => import("./pages/submit.js")],
];

/** @typedef {{path: string, params: Record<string, string>, query: URLSearchParams, section: string,
 *             load: () => Promise<{show: Function}>}} Place */

/** Where the address leads; null when nowhere. @param {string} hash @returns {Place | null} */
export function place(hash) {
  const [path, query = ""] = (hash.replace(/^#/, "") || "/").split("?");
  for (const [pattern, section, load] of ROUTES) {
    const found = pattern.exec(path);
    if (found) {
      const params = Object.fromEntries(Object.entries(found.groups ?? {}).map(([k, v]) => [k, decodeURIComponent(v)]));
      return { path, params, query: new URLSearchParams(query), section, load };
    }
  }
  return null;
}

/** An address. @param {string} path @param {Record<string, string | null | undefined>} [query] */
export function link(path, query = {}) {
  const given = Object.entries(query).filter(([, value]) => value !== null && value !== undefined && value !== "");
  return `#${path}${given.length ? `?${new URLSearchParams(given)}` : ""}`;
}

/** Address of an application's page. */
export const applicationLink = (id, rest = "", query = {}) =>
  link(`/applications/${encodeURIComponent(id)}${rest}`, query);

/** Change the query without a new entry in the history, and without showing the page anew. */
export function rememberQuery(query) {
  const path = (location.hash.replace(/^#/, "") || "/").split("?")[0];
  history.replaceState(null, "", link(path, query));
}
