// Keys of a look's timeline.
/** @import { TimelineActs, TimelineHost } from "./look-timeline-tools.js" */

/**
 * Keys and what they do.
 * @type {string[][]}
 */
export const CUT_SHORTCUTS = [
  ["← →", "the cloud before or after; with Shift ten on"],
  ["Home, End", "start, end of the recording"],
  ["+ − 0", "zoom in, out, show all; also by the wheel"],
  [", .", "choose the sequence before or after"],
  ["I, O", "its start, its end is here"],
  ["S", "split it here"],
  ["N", "add a sequence here"],
  ["Enter", "rename it"],
  ["Delete", "delete it"],
  ["Ctrl Z, Ctrl Shift Z", "undo, redo"],
  ["Esc", "choose none"],
];

/**
 * Run the action of a pressed key.
 * @param {KeyboardEvent} event
 * @param {TimelineHost} host
 * @param {TimelineActs} acts
 * @returns {boolean} whether the key has one
 */
export function handleTimelineKey(event, host, acts) {
  const editor = host.editor();
  const recording = host.recording();
  if (!recording) return false;
  const far = event.shiftKey ? 10 : 1;
  if (event.altKey) return false;
  if (event.ctrlKey || event.metaKey) {
    const key = event.key.toLowerCase();
    if (!editor || (key !== "z" && key !== "y")) return false;
    if (key === "y" || event.shiftKey) editor.redo();
    else editor.undo();
    return true;
  }
  const chosen = editor?.chosen();
  /** @type {Record<string, () => unknown>} */
  const keys = {
    arrowleft: () => acts.step(-far),
    arrowright: () => acts.step(far),
    home: () => acts.show(recording.start),
    end: () => acts.show(recording.end),
    "+": () => acts.zoom(1 / 1.5),
    "=": () => acts.zoom(1 / 1.5),
    "-": () => acts.zoom(1.5),
    0: acts.fit,
    ",": () => acts.choose(-1),
    ".": () => acts.choose(1),
    n: acts.add,
    s: acts.split,
    i: () => chosen && editor?.resize(chosen.key, "start", host.time()),
    o: () => chosen && editor?.resize(chosen.key, "end", host.time()),
    delete: acts.remove,
    backspace: acts.remove,
    enter: () => chosen && host.rename(chosen.key),
    escape: () => editor?.select(null),
    " ": () => undefined,
    l: () => undefined,
  };
  const act = keys[event.key.toLowerCase()];
  act?.();
  return Boolean(act);
}
