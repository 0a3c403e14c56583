/** The HTTP interface. */

/** A refusal in the words of the server (RFC 9457). */
export class Problem extends Error {
  /** @param {number} status @param {{detail?: string, errors?: {field: string, message: string}[]}} body */
  constructor(status, body) {
    super(body.detail ?? `the server answered ${status}`);
    this.status = status;
    this.errors = body.errors ?? [];
  }
}

async function answer(path, options) {
  const response = await fetch(path, { ...options, headers: { accept: "application/json", ...options.headers } });
  const body = response.status === 204 ? null : await response.json().catch(() => ({}));
  if (!response.ok) throw new Problem(response.status, body ?? {});
  return body;
}

/** @param {string} path @param {AbortSignal} [signal] */
export const get = (path, signal) => answer(path, { signal });
export const post = (path) => answer(path, { method: "POST" });
export const remove = (path) => answer(path, { method: "DELETE" });


/** Show a key; the answer is a cookie. @param {string} key */
export const logIn = (key) =>
  answer("/v1/session", {
    method: "POST",
    body: JSON.stringify({ key }),
    headers: { "content-type": "application/json" },
  });

/** What is not there yet is null, and anything else wrong is thrown. */
export async function getIfThere(path, signal) {
  try {
    return await get(path, signal);
  } catch (error) {
    if (error instanceof Problem && error.status === 404) return null;
    throw error;
  }
}

/** Submit an application as YAML text (JSON is YAML). The key makes a repeated click harmless. */
export const submit = (text, key) =>
  answer("/v1/applications", {
    method: "POST",
    body: text,
    headers: { "content-type": "application/yaml", "idempotency-key": key },
  });

/** Keep a robot, given as YAML text (JSON is YAML). @param {string} text */
export const uploadRobot = (text) =>
  answer("/v1/robots", { method: "POST", body: text, headers: { "content-type": "application/yaml" } });

/** The address of an application's resource. @param {string} id @param {string} [rest] */
export const ofApplication = (id, rest = "") => `/v1/applications/${encodeURIComponent(id)}${rest}`;

/** Do something to many, a few at a time; gives the errors. */
export async function forEachFew(items, act, width = 4) {
  const queue = [...items];
  const errors = [];
  const worker = async () => {
    for (let item = queue.shift(); item !== undefined; item = queue.shift()) {
      await act(item).catch((error) => errors.push(error));
    }
  };
  await Promise.all(Array.from({ length: width }, worker));
  return errors;
}
