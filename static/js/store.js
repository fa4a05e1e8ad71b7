// What the page shows, in one place; parts subscribe to the keys they draw. Some keys outlive the page.
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

const readStored = () => {
  try {
    return JSON.parse(localStorage.getItem("palpate.view")) ?? {};
  } catch {
    return {};
  }
};

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
  held: null,
  trial: false,
  live: false,
  theme: document.documentElement.dataset.theme,
  ...readStored(),
};
const listeners = [];

export const state = () => values;

export function set(changes) {
  const changed = Object.keys(changes).filter(
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

export function subscribe(keys, listener) {
  listeners.push([keys, listener]);
}
