// Keyboard shortcuts of the registration by hand.
/** @import { PairEditor, RegisterActions } from "./types.js" */

const STEP = 0.0002; // of an arrow key [m]

/**
 * Keys and what they do.
 * @type {string[][]}
 */
export const REGISTER_SHORTCUTS = [
  ["C, M", "clicks are for the cloud, for the phantom"],
  ["1 to 9", "choose that pair’s end on this side"],
  ["Arrows", "move the chosen end by 0.2 mm, with Shift by 1 mm"],
  ["Delete", "leave the chosen, else the last pair out"],
  ["Ctrl Z", "undo"],
  ["V", "cloud beside or over the phantom"],
  ["R", "look at all of it"],
  ["Enter", "refine by ICP"],
  ["Esc", "choose none; back from ICP"],
];

/**
 * Run the action of a pressed key; keys without one go on to the page's shortcuts.
 * @param {KeyboardEvent} event
 * @param {PairEditor} editor
 * @param {RegisterActions} actions
 */
export function handleRegisterShortcut(event, editor, actions) {
  const target = /** @type {Element | null} */ (event.target);
  if (target?.matches?.("input, select, textarea") || document.querySelector("dialog[open]"))
    return;
  const { chosen, pairs, mode, found, over } = editor.values;
  const far = event.shiftKey ? 5 * STEP : STEP;
  /**
   * @param {number} right
   * @param {number} up
   */
  const move = (right, up) => () => {
    if (chosen) actions.nudge(right * far, up * far);
  };
  /** @type {Record<string, () => void>} */
  const plain = {
    c: () => editor.set({ mode: "cloud", chosen: null }),
    m: () => editor.set({ mode: "mesh", chosen: null }),
    v: () => editor.set({ over: !over }),
    r: actions.look,
    ArrowLeft: move(-1, 0),
    ArrowRight: move(1, 0),
    ArrowUp: move(0, 1),
    ArrowDown: move(0, -1),
    Delete: () => {
      if (pairs.length) editor.leaveOut(chosen?.[0] ?? pairs.length - 1);
    },
    Escape: () => (found ? actions.back() : editor.choose(null)),
  };
  plain.Backspace = plain.Delete;
  if (!target?.matches?.("button")) plain.Enter = () => actions.refine();
  const number = /^[1-9]$/.test(event.key) ? +event.key - 1 : null;
  if (number !== null && number < pairs.length)
    plain[event.key] = () => editor.choose(number, mode);
  const undo = (event.ctrlKey || event.metaKey) && event.key === "z";
  const act = undo
    ? editor.undo
    : event.ctrlKey || event.metaKey || event.altKey
      ? null
      : plain[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  // The timeline is hidden during a registration, so its keys do nothing.
  const timeline =
    [" ", "Home", "End", "i", "o", "l"].includes(event.key) && !target?.matches?.("button");
  if (!act && !timeline) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  act?.();
}
