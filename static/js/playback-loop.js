// The part of a sequence that is played again and again: buttons, keys, and what is marked in the plot.
import { fill, icon, element } from "./dom.js";
import { subscribe, set, state } from "./store.js";

/** First and last frame that are played; all of them without a loop. */
export function playedRange(count) {
  const { loop } = state();
  const last = Math.max(0, count - 1);
  return loop ? [Math.min(loop[0], last), Math.min(loop[1], last)] : [0, last];
}

/** Loop between two frames in either order; one frame alone is no loop. */
export function setLoop(one, other, count) {
  const last = count - 1;
  const [from, to] = [Math.min(one, other), Math.max(one, other)].map((frame) =>
    Math.max(0, Math.min(last, frame)),
  );
  set({ loop: to > from ? [from, to] : null });
}

const loopFromHere = (count) => {
  if (count)
    setLoop(
      state().frame,
      state().loop && state().loop[1] > state().frame ? state().loop[1] : count - 1,
      count,
    );
};
const loopToHere = (count) => {
  if (count)
    setLoop(
      state().loop && state().loop[0] < state().frame ? state().loop[0] : 0,
      state().frame,
      count,
    );
};
const toggleLoop = (count) => {
  if (count > 1) set({ loop: state().loop ? null : [0, count - 1] });
};

export const LOOP_SHORTCUTS = { i: loopFromHere, o: loopToHere, l: toggleLoop };

const BUTTONS = [
  ["from", loopFromHere, "Loop from this frame (I)"],
  ["loop", toggleLoop, "Loop on or off (L); drag with Shift in the plot to choose the part"],
  ["to", loopToHere, "Loop to this frame (O)"],
];

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
