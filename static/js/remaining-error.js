// The structured error that a diagnosis leaves: how much, where, and clues to its cause.

import { element } from "./dom.js";
import { capitalise, formatPercent, readableName } from "./format.js";

/** @import { ErrorClues, Unexplained } from "./types.js" */

/**
 * Tell how much structured error no cause explains, where and when.
 * @param {Unexplained} unexplained
 * @returns {HTMLElement}
 */
export function unexplainedNote({
  fraction,
  where,
  when: time,
  structure,
  structure_bound: bound,
  rms_mm: rms,
  share_of_motion: share,
}) {
  const times =
    typeof structure === "number"
      ? `What is left is ${structure.toFixed(2)} times what chance gives, ` +
        `where more than ${bound?.toFixed(2)} would be an error with a pattern.`
      : "";
  if (fraction === 0 && times)
    return element(
      "p",
      { class: "gain-note" },
      element("b", {}, "Nothing"),
      ` beyond chance. ${times}`,
    );
  const place = [where, time].filter(Boolean).join("; ");
  return element(
    "p",
    { class: "gain-note" },
    element("b", {}, formatPercent(fraction)),
    ` of the structured error is left${sizeText(rms, share)}${place ? `: ${place}` : ""}.`,
  );
}

/**
 * Return the size of a structured error as text; empty where it is unknown.
 * @param {number | null | undefined} rms in mm
 * @param {number | null | undefined} share of the surface's motion
 * @returns {string}
 */
const sizeText = (rms, share) =>
  typeof rms === "number"
    ? `, ${rms.toFixed(2)} mm RMS or ${formatPercent(share ?? 0)} of the motion`
    : "";

/**
 * Tell of a structured error that is within the tolerance.
 * @param {Unexplained} left
 * @returns {HTMLElement}
 */
export const smallNote = ({
  rms_mm: rms,
  share_of_motion: share,
  tolerance_mm: most,
  where,
  when,
}) =>
  element(
    "p",
    { class: "gain-note" },
    `A structured error is left${sizeText(rms, share)}, within the tolerance of ` +
      `${most?.toFixed(2)} mm: ${[where, when].filter(Boolean).join("; ")}.`,
  );

/**
 * List the clues to an error that no cause explains; empty without any.
 * @param {ErrorClues | undefined} clues
 * @returns {HTMLElement[]}
 */
export function clueRows(clues) {
  if (!clues) return [];
  const rows = [
    clueBars("Size beyond noise", clues.rms_mm_when, (size) => `${size.toFixed(2)} mm`),
    clueBars("Moves with", clues.moves_with, formatPercent, 1),
    clueBars("What would stay with a cause", leftBy(clues), formatPercent, 1),
  ];
  const frames = clues.worst_frames.map(
    ({ sequence, time_s: time, rms_mm: rms }) =>
      `${sequence} at ${time.toFixed(2)} s (${rms.toFixed(2)} mm)`,
  );
  if (frames.length) rows.push(clueLine("Worst frames", frames.join(", ")));
  rows.push(clueLine("Measure next", `${capitalise(clues.measure_next)}.`));
  return rows;
}

/**
 * Return the share of the error that each set of partial causes leaves.
 * @param {ErrorClues} clues
 * @returns {Record<string, number>}
 */
const leftBy = ({ partial_causes: causes }) =>
  Object.fromEntries(
    causes
      .filter(({ effects }) => effects.length)
      .map(({ effects, left }) => [effects.map(readableName).join(" and "), left]),
  );

/**
 * @param {string} title
 * @param {Record<string, number>} values
 * @param {(value: number) => string} text
 * @param {number} most value of a full bar
 * @returns {HTMLElement}
 */
function clueBars(title, values, text, most = Math.max(...Object.values(values), 1e-12)) {
  return element(
    "div",
    { class: "clue" },
    element("span", {}, title),
    Object.entries(values).map(([name, value]) =>
      element(
        "div",
        { class: "clue-bar" },
        element("small", {}, name),
        element("i", { style: { width: `${Math.round((60 * value) / most)}px` } }),
        element("b", {}, text(value)),
      ),
    ),
  );
}

/**
 * @param {string} title
 * @param {string} text
 * @returns {HTMLElement}
 */
const clueLine = (title, text) =>
  element("div", { class: "clue" }, element("span", {}, title), element("p", {}, text));
