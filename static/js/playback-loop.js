// The looped part of a sequence: its buttons and shortcuts.
import { fill, icon, element } from "./dom.js";
import { subscribe, set, state } from "./store.js";

/**
 * Return the first and the last frame that are played; without a loop those of the sequence.
 * @param {number} count frames of the sequence
 * @returns {[number, number]}
 */
export function playedRange(count) {
  const { loop } = state();
  const last = Math.max(0, count - 1);
  return loop ? [Math.min(loop[0], last), Math.min(loop[1], last)] : [0, last];
}

/**
 * Loop between two frames, given in either order; one frame alone ends the loop.
 * @param {number} one
 * @param {number} other
 * @param {number} count
 */
export function setLoop(one, other, count) {
  const last = count - 1;
  const [from, to] = [Math.min(one, other), Math.max(one, other)].map((frame) =>
    Math.max(0, Math.min(last, frame)),
  );
  set({ loop: to > from ? [from, to] : null });
}

/**
 * Start the loop at the shown frame.
 * @param {number} count
 */
const loopFromHere = (count) => {
  const { loop, frame } = state();
  if (count) setLoop(frame, loop && loop[1] > frame ? loop[1] : count - 1, count);
};

/**
 * End the loop at the shown frame.
 * @param {number} count
 */
const loopToHere = (count) => {
  const { loop, frame } = state();
  if (count) setLoop(loop && loop[0] < frame ? loop[0] : 0, frame, count);
};

/**
 * Loop over the whole sequence, or end the loop.
 * @param {number} count
 */
const toggleLoop = (count) => {
  if (count > 1) set({ loop: state().loop ? null : [0, count - 1] });
};

/**
 * Actions of the page's keys.
 * @type {Record<string, (count: number) => void>}
 */
export const LOOP_SHORTCUTS = { i: loopFromHere, o: loopToHere, l: toggleLoop };

/** @type {[string, (count: number) => void, string][]} */
const BUTTONS = [
  ["from", loopFromHere, "Loop from this frame (I)"],
  ["loop", toggleLoop, "Loop on or off (L); drag with Shift in the plot to choose the part"],
  ["to", loopToHere, "Loop to this frame (O)"],
];

/**
 * Draw the loop's buttons; `count` returns the number of frames.
 * @param {() => number} count
 */
export function start(count) {
  const draw = () =>
    fill(
      "looping",
      BUTTONS.map(([name, action, title]) =>
        element(
          "button",
          {
            id: `loop-${name}`,
            class: "icon-button",
            type: "button",
            title,
            "aria-pressed": name === "loop" ? String(state().loop !== null) : null,
            onclick: () => action(count()),
          },
          icon(name),
        ),
      ),
    );
  subscribe(["loop"], draw);
  draw();
}
