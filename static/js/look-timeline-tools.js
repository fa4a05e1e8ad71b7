// The buttons above a look's timeline.
import { element, fill, icon } from "./dom.js";
import { keepFocus } from "./keep-focus.js";
import { nearest } from "./look-timeline-readings.js";

/** @import { CutEditor, CutSequence, LookRecording } from "./types.js" */

/**
 * What the timeline shows, and what it asks of the panel.
 * @typedef {object} TimelineHost
 * @property {() => LookRecording | null} recording
 * @property {() => LookRecording[]} recordings
 * @property {() => CutEditor | null} editor null where nothing can be cut
 * @property {(recording: string) => CutSequence[]} sequences
 * @property {() => number} time
 * @property {(time: number) => void} goTo
 * @property {(index: number) => void} choose
 * @property {(key: number) => void} rename brings the name of a sequence to the keyboard
 */

/**
 * What buttons and keys of the timeline do.
 * @typedef {object} TimelineActs
 * @property {(by: number) => void} step to other clouds
 * @property {(time: number) => void} show
 * @property {(factor: number) => void} zoom
 * @property {() => void} fit
 * @property {() => void} add
 * @property {() => void} split
 * @property {() => void} remove
 * @property {(by: number) => void} choose
 */

/**
 * Draw the buttons above the timeline; the one that had the focus has it again.
 * @param {HTMLElement} box
 * @param {TimelineHost} host
 * @param {TimelineActs} acts
 * @param {LookRecording} recording
 */
export function drawTools(box, host, acts, recording) {
  const editor = host.editor();
  const chosen = editor?.chosen() ?? null;
  const time = host.time();
  const inside = chosen && chosen.start < time && time < chosen.end;
  /**
   * @param {string} name of the icon
   * @param {string} title
   * @param {() => unknown} act
   * @param {boolean} [off]
   * @returns {HTMLElement}
   */
  const button = (name, title, act, off = false) =>
    element(
      "button",
      {
        class: "icon-button",
        type: "button",
        title,
        "aria-label": title,
        "data-act": name,
        disabled: off,
        onclick: act,
      },
      icon(name),
    );
  const recordings = host.recordings();
  const { t, shown } = recording.clouds ?? { t: [], shown: [] };
  const cloud = shown.length
    ? nearest(
        shown.map((at) => t[at]),
        time,
      )
    : null;
  keepFocus(box, "data-act", () =>
    fill(
      box,
      recordings.length > 1
        ? element(
            "select",
            {
              "aria-label": "Recording",
              "data-act": "recording",
              onchange: ({ target }) => host.choose(target.selectedIndex),
            },
            recordings.map(({ name }) =>
              element("option", { selected: name === recording.name }, name),
            ),
          )
        : null,
      element(
        "div",
        { class: "buttons" },
        button("back", "Back to the cloud before (Left)", () => acts.step(-1)),
        button("forth", "On to the next cloud (Right)", () => acts.step(1)),
      ),
      element(
        "output",
        { class: "clock" },
        element("strong", {}, `${(time - recording.start).toFixed(2)} s`),
      ),
      cloud === null
        ? null
        : element("span", { class: "label" }, `cloud ${cloud + 1} of ${shown.length}`),
      element("div", { class: "spring" }),
      editor
        ? element(
            "div",
            { class: "buttons" },
            button("add", "Add a sequence at the cursor (N)", acts.add),
            button("split", "Split the chosen sequence at the cursor (S)", acts.split, !inside),
            button("bin", "Delete the chosen sequence (Delete)", acts.remove, !chosen),
            button("undo", "Undo (Ctrl Z)", editor.undo, !editor.canUndo()),
            button("redo", "Redo (Ctrl Shift Z)", editor.redo, !editor.canRedo()),
          )
        : null,
      element(
        "div",
        { class: "buttons" },
        button("minus", "Zoom out (−)", () => acts.zoom(1.5)),
        button("plus", "Zoom in (+)", () => acts.zoom(1 / 1.5)),
        button("fit", "Show all (0)", acts.fit),
      ),
    ),
  );
}
