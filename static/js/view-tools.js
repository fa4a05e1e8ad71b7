// Looking at the scene: standard views, models side by side, and the section through the block.
import { post, toast } from "./api.js";
import { forgetCamera } from "./camera.js";
import { element, fill, icon } from "./dom.js";
import { bindShortcuts } from "./shortcuts.js";
import { inDrawOrder } from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";

const VIEWS = [
  ["reset", "target", "Look at the phantom again (0)"],
  ["top", "top", "From the top (1)"],
  ["front", "front", "From the front (2)"],
  ["side", "side", "From the side (3)"],
];
const AXES = ["x", "y", "z"];
let look = () => {};

export function start(page) {
  look = (where) => {
    forgetCamera();
    post(`/sessions/${page}/look?where=${where}`).catch(toast);
  };
  for (const [where, shape, title] of VIEWS)
    initToolButton(`${where}-view`, shape, title, () => look(where));
  initToolButton("aside", "columns", "Models side by side (B)", toggleSideBySide);
  initToolButton("section", "section", "Cut the block open (X)", toggleSection);
  initToolButton(
    "crop",
    "cloud",
    "Show the whole cloud, not only the points near the phantom",
    () => set({ crop: !state().crop }),
  );
  bindShortcuts({
    0: () => look("reset"),
    1: () => look("top"),
    2: () => look("front"),
    3: () => look("side"),
    b: toggleSideBySide,
    x: toggleSection,
  });
  subscribe(["side_by_side", "section", "crop"], updatePressed);
  subscribe(["section", "series"], drawSection);
  updatePressed();
  drawSection();
}

export function initToolButton(id, shape, title, act) {
  const node = fill(id, icon(shape));
  Object.assign(node, { type: "button", title });
  node.classList.add("icon-button");
  node.addEventListener("click", act);
}

function toggleSideBySide() {
  set({ side_by_side: !state().side_by_side });
}

function updatePressed() {
  const pressed = {
    aside: state().side_by_side,
    section: Boolean(state().section?.on),
    crop: !state().crop,
  };
  for (const [id, value] of Object.entries(pressed))
    document.getElementById(id).setAttribute("aria-pressed", String(value));
}

function toggleSection() {
  const { section, series } = state();
  if (!series) return;
  const wanted = section
    ? { ...section, on: !section.on }
    : { on: true, axis: "y", at: middleOf("y"), flip: false };
  // Who opens the block wants to see what was found in it.
  set({
    section: wanted,
    layers: wanted.on && series.lumps ? inDrawOrder([...state().layers, "lump"]) : state().layers,
  });
}

const middleOf = (axis) => {
  const [low, high] = state().series.box;
  const at = AXES.indexOf(axis);
  return (low[at] + high[at]) / 2;
};

function drawSection() {
  const { section, series } = state();
  const box = document.getElementById("section-bar");
  box.hidden = !section?.on || !series;
  if (
    box.hidden ||
    (box.contains(document.activeElement) && document.activeElement.type === "range")
  )
    return;
  const at = AXES.indexOf(section.axis);
  const [low, high] = series.box.map((corner) => corner[at] * 1e3);
  const number = element("output", {}, `${(section.at * 1e3).toFixed(1)} mm`);
  const bar = element("input", {
    type: "range",
    min: Math.ceil(low * 10) / 10,
    max: Math.floor(high * 10) / 10,
    step: 0.1,
    value: section.at * 1e3,
    "aria-label": `Section at ${section.axis} in mm`,
    oninput: (event) => {
      set({ section: { ...state().section, at: +event.target.value / 1e3 } });
      number.textContent = `${(+event.target.value).toFixed(1)} mm`;
    },
  });
  bar.addEventListener("change", () => bar.blur());
  fill(
    box,
    element("span", { class: "label" }, "Section across"),
    element(
      "div",
      { class: "segments", role: "radiogroup", "aria-label": "Axis of the section" },
      AXES.map((axis) =>
        element(
          "button",
          {
            type: "button",
            role: "radio",
            "aria-checked": String(axis === section.axis),
            "data-axis": axis,
            onclick: () => set({ section: { ...section, axis, at: middleOf(axis) } }),
          },
          axis,
        ),
      ),
    ),
    bar,
    number,
    element(
      "button",
      {
        class: "button small",
        type: "button",
        title: "Keep the other part",
        onclick: () => set({ section: { ...section, flip: !section.flip } }),
      },
      "Other part",
    ),
    series.inside ? element("span", { class: "muted", title: series.inside }, "shell only") : null,
    element(
      "button",
      {
        class: "icon-button",
        type: "button",
        title: "Close the section (X)",
        "aria-label": "Close the section",
        onclick: toggleSection,
      },
      icon("close"),
    ),
  );
}
