// Errors of an import, each at the step that it concerns.
import { errorTitle } from "./api.js";
import { element } from "./dom.js";
import { capitalise } from "./format.js";

/** @import { ServerError } from "./types.js" */

/** @typedef {"files" | "streams" | "setup" | "meaning" | "cut" | "name" | "other"} Step */

const SETUP = ["phantom", "tool", "camera", "landmarks", "robot", "setup", "material", "support"];
/** @type {[RegExp, Step][]} */
const BY_KEY = [
  [/^name$/, "name"],
  [/^(body|file|files|folder|path)$/, "files"],
  [/^(pose|wrench|time|tables)\./, "meaning"],
  [/^(streams?|topics)\b/, "streams"],
  [/^(sequences?|splits|cutting)\b/, "cut"],
  [new RegExp(`^(${SETUP.join("|")})\\b`), "setup"],
];

/**
 * Return the step that an error concerns.
 * @param {ServerError} problem
 * @param {boolean} looked whether there is a look
 * @returns {Step}
 */
export function stepOf({ message, where = {} }, looked) {
  const key = String(where.key ?? "");
  const found = BY_KEY.find(([pattern]) => pattern.test(key))?.[1];
  if (found) return found;
  if (where.stream || where.role) return "streams";
  if (where.sequence) return "cut";
  if (where.file === "dataset.toml" || /are not stated/.test(message)) return "setup";
  if (/no stream|no pose|tool's poses/i.test(message)) return "streams";
  return looked ? "other" : "files";
}

/**
 * Return the card of an error where it belongs to a step; null elsewhere.
 * @param {ServerError | null} problem
 * @param {Step} step
 * @param {boolean} looked
 * @returns {HTMLElement | null}
 */
export function problemAt(problem, step, looked) {
  if (!problem || stepOf(problem, looked) !== step) return null;
  const where = Object.entries(problem.where ?? {}).filter(([key]) => key !== "problems");
  return element(
    "div",
    { class: "note-card bad", role: "alert", "data-problem": step },
    element("strong", {}, problem.kind ? errorTitle(problem) : "Something is missing"),
    capitalise(problem.message),
    step === "streams" && looked ? " On this page: choose it in the column “Taken as”." : null,
    where.length
      ? element(
          "div",
          { class: "where" },
          where.map(([key, value]) => `${key}: ${value}`).join("  "),
        )
      : null,
  );
}
