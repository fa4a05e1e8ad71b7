// The list of the sequences of a look: each a line; the chosen one with fields for its name, kind,
// split and times.
import { element, icon } from "./dom.js";
import { KINDS } from "./look-timeline-readings.js";

/**
 * @import {
 *   CutEditor, CutKind, CutSequence, ImportActions, ImportView, LookRecording
 * } from "./types.js"
 */

/** @type {Record<string, string>} */
export const SPLITS = {
  "": "no split",
  train: "train",
  validation: "validation",
  test: "test",
};

/**
 * @param {ImportView} view
 * @param {CutEditor | null} editor null where nothing can be changed
 * @param {(recording: string) => CutSequence[]} sequencesOf
 * @param {ImportActions} actions
 * @param {HTMLElement | null} problem
 * @returns {HTMLElement | null}
 */
export function cutSection(view, editor, sequencesOf, actions, problem) {
  const { look } = view;
  if (!look?.recordings.length) return null;
  const fixed = look.source.kind === "dataset";
  const sequences = look.recordings.flatMap(({ name }) => sequencesOf(name));
  return element(
    "section",
    { class: "import-step", "aria-label": "Sequences" },
    element(
      "h2",
      {},
      fixed ? "Sequences" : "4  Sequences",
      editor?.changed
        ? element(
            "button",
            { class: "link", type: "button", "data-key": "revert", onclick: editor.revert },
            "As they were found",
          )
        : null,
    ),
    element(
      "ul",
      { class: "cut-list" },
      sequences.map((one) => row(one, look.recordings, editor, actions)),
    ),
    sequences.length
      ? null
      : element(
          "p",
          { class: "empty" },
          look.setup_stated
            ? "None was found. Draw one in the timeline’s lowest row, or press N there."
            : "Contacts are found once a phantom is stated.",
        ),
    problem,
    fixed || !sequences.length
      ? null
      : element(
          "p",
          { class: "import-hint" },
          "In the timeline, drag the ends of a bar, or draw a new one in its row. Keys: , and . " +
            "choose, I and O set start and end, S splits, N adds, Delete removes, Ctrl Z undoes.",
        ),
  );
}

/**
 * @param {CutSequence} one
 * @param {LookRecording[]} recordings
 * @param {CutEditor | null} editor
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function row(one, recordings, editor, actions) {
  const { key, name, kind, start, end, split } = one;
  const at = recordings.findIndex((other) => other.name === one.recording);
  const zero = recordings[at]?.start ?? 0;
  const chosen = editor?.selected === key;
  const wrong = editor?.problems().filter((problem) => problem.key === key) ?? [];
  const line = element(
    "button",
    {
      class: "cut-line",
      type: "button",
      "aria-expanded": editor ? String(chosen) : null,
      "data-key": `cut ${key}`,
      title: recordings.length > 1 ? `of ${one.recording}` : null,
      onclick: () => {
        editor?.select(chosen ? null : key);
        actions.chooseRecording(at, start);
      },
    },
    element("i", { class: "swatch", style: { background: `var(--kind-${kind || "none"})` } }),
    element("span", { class: "name" }, name || "without a name"),
    split ? element("span", { class: `tag ${split}` }, shortSplit(split)) : null,
    element(
      "span",
      { class: "value" },
      `${(start - zero).toFixed(1)} – ${(end - zero).toFixed(1)} s`,
    ),
  );
  return element(
    "li",
    { "data-sequence-cut": name, class: chosen ? "chosen" : wrong.length ? "wrong" : null },
    line,
    chosen && editor ? fields(one, zero, editor) : null,
    wrong.map(({ field, text }) =>
      element(
        "p",
        { class: "import-field-problem", id: `wrong-${key}-${field}`, role: "alert" },
        text,
      ),
    ),
  );
}

/**
 * @param {CutSequence} one
 * @param {number} zero
 * @param {CutEditor} editor
 * @returns {HTMLElement}
 */
function fields(one, zero, editor) {
  const { key, name, kind, split } = one;
  const wrong = editor.problems().some((problem) => problem.key === key);
  /**
   * @param {string} label
   * @param {string} field
   * @param {Record<string, string>} entries
   * @param {string} value
   * @param {(value: string) => void} put
   * @returns {HTMLElement}
   */
  const select = (label, field, entries, value, put) =>
    element(
      "label",
      {},
      label,
      element(
        "select",
        { "data-key": `${field} ${key}`, onchange: ({ target }) => put(target.value) },
        Object.entries(entries).map(([choice, text]) =>
          element("option", { value: choice, selected: choice === value }, text),
        ),
      ),
    );
  /**
   * @param {"start" | "end"} edge
   * @returns {HTMLElement}
   */
  const time = (edge) =>
    element(
      "label",
      {},
      edge === "start" ? "Start, s" : "End, s",
      element("input", {
        type: "number",
        step: "0.1",
        value: (one[edge] - zero).toFixed(2),
        "data-key": `${edge} ${key}`,
        onchange: ({ target }) => {
          if (target.value !== "") editor.resize(key, edge, zero + Number(target.value));
        },
      }),
    );
  return element(
    "div",
    { class: "cut-fields" },
    element(
      "label",
      { class: "wide" },
      "Name",
      element("input", {
        value: name,
        maxlength: 64,
        autocomplete: "off",
        "data-key": `name ${key}`,
        "aria-invalid": wrong ? "true" : null,
        "aria-describedby": wrong ? `wrong-${key}-name` : null,
        onchange: ({ target }) => editor.alter(key, { name: target.value.trim() }),
      }),
    ),
    element(
      "button",
      {
        class: "icon-button",
        type: "button",
        title: `Delete ${name}`,
        "aria-label": `Delete ${name}`,
        onclick: () => editor.remove(key),
      },
      icon("bin"),
    ),
    select("Kind", "kind", KINDS, kind ?? "", (value) =>
      editor.alter(key, { kind: /** @type {CutKind} */ (value) }),
    ),
    select("Split", "split", SPLITS, split ?? "", (value) =>
      editor.alter(key, { split: value || null }),
    ),
    time("start"),
    time("end"),
  );
}

/**
 * @param {string} split
 * @returns {string}
 */
const shortSplit = (split) => ({ train: "fit", validation: "val", test: "test" })[split] ?? split;
