// State of the page: modules read it with `state`, change it with `set`, and subscribe to the
// keys they draw. The keys in STORED_KEYS are kept in the browser's local storage.
/** @import { State } from "./types.js" */

/** @type {(keyof State)[]} */
const STORED_KEYS = [
  "run",
  "sequence",
  "layers",
  "colour",
  "quantity",
  "ranges",
  "limits",
  "looks",
  "side_by_side",
  "section",
  "speed",
  "crop",
];

/** @returns {Partial<State>} */
const readStored = () => {
  try {
    return JSON.parse(localStorage.getItem("palpate.view") ?? "{}") ?? {};
  } catch {
    return {};
  }
};

/** @type {State} */
const values = {
  run: null,
  sequence: null,
  frame: 0,
  playing: false,
  layers: ["measured", "raw", "tool", "base"],
  colour: "raw",
  quantity: "error",
  ranges: {},
  limits: {},
  looks: {},
  side_by_side: false,
  section: null,
  crop: true,
  speed: 1,
  loop: null,
  report: null,
  heading: null,
  series: null,
  palette: null,
  rendered: null,
  trial: false,
  live: false,
  theme: document.documentElement.dataset.theme ?? "light",
  ...readStored(),
};
/** @type {[(keyof State)[], (state: State) => void][]} */
const listeners = [];

/**
 * Return the state; treat it as read-only.
 * @returns {State}
 */
export const state = () => values;

/**
 * Change keys of the state and call the subscribers of those whose value differs.
 * @param {Partial<State>} changes
 */
export function set(changes) {
  const changed = /** @type {(keyof State)[]} */ (Object.keys(changes)).filter(
    (key) => JSON.stringify(values[key]) !== JSON.stringify(changes[key]),
  );
  if (!changed.length) return;
  Object.assign(values, changes);
  if (changed.some((key) => STORED_KEYS.includes(key))) {
    localStorage.setItem(
      "palpate.view",
      JSON.stringify(Object.fromEntries(STORED_KEYS.map((key) => [key, values[key]]))),
    );
  }
  for (const [keys, listener] of listeners)
    if (changed.some((key) => keys.includes(key))) listener(values);
}

/**
 * Call the listener with the state whenever one of the keys has changed.
 * @param {(keyof State)[]} keys
 * @param {(state: State) => void} listener
 */
export function subscribe(keys, listener) {
  listeners.push([keys, listener]);
}
