// Single values of import.toml, read and replaced in its text; the rest stays as it was written.

/**
 * Return a value of a table as TOML text; null where the table does not have it.
 * @param {string | null} text of import.toml
 * @param {string} table
 * @param {string} key
 * @returns {string | null}
 */
export function mappingValue(text, table, key) {
  const lines = (text ?? "").split("\n");
  const at = lineOf(lines, table, key);
  return at < 0 ? null : lines[at].slice(lines[at].indexOf("=") + 1).trim();
}

/**
 * Return the text with values replaced or added.
 * @param {string} text of import.toml
 * @param {Record<string, string>} values TOML text by "table.key"
 * @returns {string}
 */
export function withValues(text, values) {
  const lines = text.split("\n");
  for (const [path, value] of Object.entries(values)) {
    const [table, key] = path.split(".");
    const at = lineOf(lines, table, key);
    const head = lines.findIndex((line) => line.trim() === `[${table}]`);
    if (at >= 0) lines[at] = `${key} = ${value}`;
    else if (head >= 0) lines.splice(head + 1, 0, `${key} = ${value}`);
    else lines.push(`[${table}]`, `${key} = ${value}`, "");
  }
  return lines.join("\n");
}

/**
 * Return the index of the line of a key; -1 where there is none.
 * @param {string[]} lines
 * @param {string} table
 * @param {string} key
 * @returns {number}
 */
function lineOf(lines, table, key) {
  let within = false;
  for (const [at, line] of lines.entries()) {
    if (line.trim().startsWith("[") && !line.includes("=")) within = line.trim() === `[${table}]`;
    else if (within && line.split("=")[0].trim() === key) return at;
  }
  return -1;
}

/**
 * Return the text within quotes of a TOML string; "" for none.
 * @param {string | null} value
 * @returns {string}
 */
export const unquoted = (value) => (value ?? "").replace(/^["']|["']$/g, "");

/**
 * Return the numbers of a TOML list.
 * @param {string | null} value
 * @returns {number[]}
 */
export const numbers = (value) =>
  (value ?? "")
    .replace(/[[\]]/g, "")
    .split(",")
    .map(Number)
    .filter((one) => Number.isFinite(one));
