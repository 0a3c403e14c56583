/** Write plain data as YAML that a person can go on with. */

const PLAIN = /^[A-Za-z_][\w .+/-]*$/;
const READ_AS_ELSE = /^(y|n|yes|no|true|false|on|off|null)$/i;

/** @param {any} value @returns {string} */
export function toYaml(value) {
  return `${lines(value, "").join("\n")}\n`;
}

function lines(value, indent) {
  return Object.entries(value).flatMap(([key, below]) => {
    if (isObject(below) && Object.keys(below).length > 0) return [`${indent}${key}:`, ...lines(below, `${indent}  `)];
    if (Array.isArray(below) && below.some(isObject)) {
      return [`${indent}${key}:`, ...below.flatMap((item) => listItem(item, `${indent}  `))];
    }
    return [`${indent}${key}: ${inline(below)}`];
  });
}

/** The first field stands behind the dash. */
function listItem(item, indent) {
  const [first, ...rest] = lines(item, `${indent}  `);
  return [`${indent}- ${first.trimStart()}`, ...rest];
}

function inline(value) {
  if (Array.isArray(value)) return `[${value.map(inline).join(", ")}]`;
  if (isObject(value)) return "{}";
  if (typeof value !== "string") return JSON.stringify(value);
  return PLAIN.test(value) && !READ_AS_ELSE.test(value) && value === value.trim() ? value : JSON.stringify(value);
}

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/**
 * The line of a field in YAML as people write it: each part of the path is looked for below the one before.
 *
 * @param {string} text @param {string} path such as tasks[1].start_rad[0] @returns {number} from 0; -1 when not found
 */
export function lineOf(text, path) {
  const rows = text.split("\n");
  let at = -1;
  let depth = -1;
  for (const part of path.match(/[^.[\]]+/g) ?? []) {
    const next = /^\d+$/.test(part) ? dash(rows, at, depth, Number(part)) : keyBelow(rows, at, part);
    if (next === -1) break;
    at = next;
    depth = rows[at].search(/\S/);
  }
  return at;
}

function keyBelow(rows, from, key) {
  const pattern = new RegExp(`(^|[\\s{,"'-])${key.replace(/\W/g, "\\$&")}["']?\\s*:`);
  for (let k = Math.max(from, 0); k < rows.length; k += 1) if (pattern.test(rows[k])) return k;
  return -1;
}

function dash(rows, from, depth, index) {
  let left = index;
  let indent = null;
  for (let k = from + 1; k < rows.length; k += 1) {
    const found = /^(\s*)- /.exec(rows[k]);
    if (found && (indent === null || found[1].length === indent)) {
      if (found[1].length < depth) return -1;
      indent = found[1].length;
      if (left === 0) return k;
      left -= 1;
    } else if (rows[k].trim() && rows[k].search(/\S/) <= depth && !found) return -1;
  }
  return -1;
}
