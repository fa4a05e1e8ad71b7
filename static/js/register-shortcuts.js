// The keyboard of manual registration.
const STEP = 0.0002;

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

/** Does what a key asks for; keys that are nobody's here go on to others. */
export function handleRegisterShortcut(event, work, actions) {
  if (event.target?.matches?.("input, select, textarea") || document.querySelector("dialog[open]"))
    return;
  const { chosen, pairs, mode, found, over } = work.values;
  const far = event.shiftKey ? 5 * STEP : STEP;
  const move = (right, up) => () => {
    if (chosen) actions.nudge(right * far, up * far);
  };
  const plain = {
    c: () => work.set({ mode: "cloud", chosen: null }),
    m: () => work.set({ mode: "mesh", chosen: null }),
    v: () => work.set({ over: !over }),
    r: actions.look,
    ArrowLeft: move(-1, 0),
    ArrowRight: move(1, 0),
    ArrowUp: move(0, 1),
    ArrowDown: move(0, -1),
    Delete: () => pairs.length && work.leaveOut(chosen?.[0] ?? pairs.length - 1),
    Escape: () => (found ? actions.back() : work.choose(null)),
  };
  plain.Backspace = plain.Delete;
  if (!event.target?.matches?.("button")) plain.Enter = () => actions.refine();
  const number = /^[1-9]$/.test(event.key) ? +event.key - 1 : null;
  if (number !== null && number < pairs.length) plain[event.key] = () => work.choose(number, mode);
  const undo = (event.ctrlKey || event.metaKey) && event.key === "z";
  const act = undo
    ? work.undo
    : event.ctrlKey || event.metaKey || event.altKey
      ? null
      : plain[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  const timeline =
    [" ", "Home", "End", "i", "o", "l"].includes(event.key) && !event.target?.matches?.("button");
  if (!act && !timeline) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  act?.();
}
