// Tools beside the scene: standard views, models side by side, the section through the block.
import { post, toast } from "./api.js";
import { forgetCamera } from "./camera.js";
import { byId, element, fill, icon } from "./dom.js";
import { eyeOf } from "./drag.js";
import { bindShortcuts } from "./shortcuts.js";
import { inDrawOrder } from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";

/** @import { Axis, Section, ViewerWindow } from "./types.js" */

/** Name of the view, its icon, and the button's title. */
const VIEWS = [
  ["reset", "target", "Look at the phantom again (0)"],
  ["top", "top", "From the top (1)"],
  ["front", "front", "From the front (2)"],
  ["side", "side", "From the side (3)"],
];
/** @type {Axis[]} */
const AXES = ["x", "y", "z"];
/** @type {(where: string) => void} */
let look = () => {};

/**
 * Set the buttons up.
 * @param {string} page identifier of this page's session
 */
export function start(page) {
  look = (where) => {
    forgetCamera();
    post(`/sessions/${page}/look?where=${where}`).catch(toast);
  };
  for (const [where, shape, title] of VIEWS)
    initToolButton(`${where}-view`, shape, title, () => look(where));
  initToolButton("aside", "columns", "Models side by side (B)", toggleSideBySide);
  initToolButton("section", "section", "Cut the phantom open (X)", toggleSection);
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

/**
 * Give a button of index.html its icon, title and action.
 * @param {string} id
 * @param {string} shape
 * @param {string} title
 * @param {() => void} act
 */
export function initToolButton(id, shape, title, act) {
  const node = byId(id, HTMLButtonElement);
  fill(node, icon(shape));
  Object.assign(node, { type: "button", title });
  node.classList.add("icon-button");
  node.addEventListener("click", act);
}

function toggleSideBySide() {
  set({ side_by_side: !state().side_by_side });
}

/** Show on the buttons what is switched on. */
function updatePressed() {
  const pressed = {
    aside: state().side_by_side,
    section: Boolean(state().section?.on),
    crop: !state().crop,
  };
  for (const [id, value] of Object.entries(pressed))
    byId(id).setAttribute("aria-pressed", String(value));
}

/** Open or close the section; opening it also shows the lumps found. */
function toggleSection() {
  const { section, series } = state();
  if (!series) return;
  /** @type {Section} */
  const next = section
    ? { ...section, on: !section.on }
    : { on: true, axis: "y", at: middleOf("y"), flip: hidesCut("y") };
  set({
    section: next,
    layers: next.on && series.lumps ? inDrawOrder([...state().layers, "lump"]) : state().layers,
  });
}

/**
 * Return the block's middle along an axis [m].
 * @param {Axis} axis
 * @returns {number}
 */
const middleOf = (axis) => {
  const [low, high] = state().series?.box ?? [
    [0, 0, 0],
    [0, 0, 0],
  ];
  const at = AXES.indexOf(axis);
  return (low[at] + high[at]) / 2;
};

/**
 * Tell whether the part below the middle of an axis would stand between the eye and the cut.
 * @param {Axis} axis
 * @returns {boolean}
 */
const hidesCut = (axis) => {
  const viewer = /** @type {ViewerWindow | null} */ (
    byId("viewer", HTMLIFrameElement).contentWindow
  );
  const eye = viewer && eyeOf(viewer);
  return Boolean(eye && eye[AXES.indexOf(axis)] < middleOf(axis));
};

/** Draw the bar of the section, unless its slider is being dragged. */
function drawSection() {
  const { section, series } = state();
  const box = byId("section-bar");
  const open = section?.on && series;
  box.hidden = !open;
  const focused = document.activeElement;
  const dragged = focused instanceof HTMLInputElement && focused.type === "range";
  if (!open || (dragged && box.contains(focused))) return;
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
      set({ section: { ...(state().section ?? section), at: +event.target.value / 1e3 } });
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
            onclick: () =>
              set({ section: { ...section, axis, at: middleOf(axis), flip: hidesCut(axis) } }),
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
