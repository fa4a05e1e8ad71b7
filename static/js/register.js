// Registration by hand: points are clicked on cloud and phantom; three pairs or more give a
// fit, which ICP refines and which is accepted under a name or not.
import { errorCard, get, post, toast, toError } from "./api.js";
import { element, fill, icon } from "./dom.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { drawPanel } from "./register-panel.js";
import { lastDataset, completePairs, createPairEditor } from "./register-pairs.js";
import { pageId } from "./scene.js";
import { handleRegisterShortcut } from "./register-shortcuts.js";

/**
 * @import {
 *   CompletePair, IcpResult, PairEditor, PairValues, Point, PointPair, RegisterActions,
 *   RegisterView, ServerError, Side
 * } from "./types.js"
 */

const ENDS = ["phantom", "cloud"];
/** @type {HTMLElement} */
let box;
/** @type {HTMLIFrameElement} */
let frame;
/** @type {HTMLElement} */
let bar;
/** @type {PairEditor | null} */
let editor = null;
/** @type {WebSocket | null} */
let socket = null;
/** @type {RegisterView} */
const view = {
  dataset: null,
  datasets: [],
  folder: null,
  fit: null,
  problem: null,
  busy: null,
  names: [],
  landmarks: {},
  stated: true,
  cannot: null,
  refused: null,
  missed: null,
  accepted: null,
};
let fitRequests = 0; // number of the newest request for a fit
let sending = false;
let stale = false; // the scene has changed since the last request
/** @type {string | null} */
let drawnState = null; // what the panel shows, as JSON
/** @type {(dataset: string) => unknown} */
let openDatasetPanel = () => undefined;

/**
 * Add the panel, its scene and the bar above the scene.
 * @param {(dataset: string) => unknown} openDataset
 */
export function startRegister(openDataset) {
  openDatasetPanel = openDataset;
  box = addPanel("register", "Register", open, leave);
  frame = element("iframe", {
    id: "register-viewer",
    title: "3D scene: rest cloud and phantom, to be clicked",
    hidden: true,
  });
  bar = element("div", {
    id: "register-bar",
    class: "register-bar",
    role: "toolbar",
    "aria-label": "What clicks are for",
  });
  document.querySelector(".scene")?.append(frame);
  document.querySelector(".centre")?.prepend(bar);
  frame.addEventListener("load", () => {
    applyTheme();
    frame.contentWindow?.addEventListener("keydown", onKeyDown, true);
  });
  window.addEventListener("keydown", onKeyDown, true);
}

/**
 * Bring the panel to the front for a dataset.
 * @param {string} dataset
 */
export function openRegistration(dataset) {
  choose(dataset).catch(toast);
  openPanel("register");
}

/**
 * Create the choice between the automatic registration and those that were accepted; hidden where
 * there are none.
 * @param {string} dataset
 * @returns {Promise<HTMLSelectElement>}
 */
export async function cameraSelect(dataset) {
  /** @type {{ registrations: string[] }} */
  const { registrations } = await get(
    `/datasets/${encodeURIComponent(dataset)}/registrations`,
  ).catch(() => ({ registrations: [] }));
  return element(
    "select",
    { "aria-label": "Camera registration", name: "registration", hidden: !registrations.length },
    element("option", { value: "" }, "Registered automatically"),
    registrations.map((name) => element("option", { value: name }, `As accepted: ${name}`)),
  );
}

/** Open scene and socket and show the last dataset. */
async function open() {
  drawnState = null;
  document.body.classList.add("registering");
  if (!frame.src) frame.src = `/viser/${pageId()}-register`;
  frame.hidden = false;
  connect();
  try {
    /** @type {{ datasets: string[], folder: string }} */
    const { datasets, folder } = await get("/datasets");
    Object.assign(view, { datasets, folder });
    const dataset =
      view.dataset ?? [lastDataset(), datasets[0]].find((name) => name && datasets.includes(name));
    if (dataset) await choose(dataset);
    else draw();
  } catch (problem) {
    fill(box, errorCard(problem));
  }
}

/** Show the page's scene again. */
function leave() {
  document.body.classList.remove("registering");
  frame.hidden = true;
  socket?.close();
  socket = null;
}

/**
 * Show a dataset with the pairs that are stored for it.
 * @param {string} dataset
 */
async function choose(dataset) {
  if (view.dataset !== dataset || !editor) {
    Object.assign(view, { dataset, fit: null, problem: null, names: [] });
    editor = createPairEditor(dataset, (pairsChanged) => {
      draw();
      sendScene();
      if (pairsChanged) fit();
    });
    editor.set({ chosen: null });
    fit();
  }
  draw();
  sendScene();
  await listNames();
}

/** Load the names of the accepted registrations. */
async function listNames() {
  const { registrations } = await get(registrationsPath());
  view.names = registrations;
  draw();
}

/** @returns {string} */
const registrationsPath = () => `/datasets/${encodeURIComponent(view.dataset ?? "")}/registrations`;

/** Open the socket on which the server sends the point of each click in the scene. */
function connect() {
  if (socket) return;
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const path = `/api/sessions/${pageId()}/registering/clicks`;
  socket = new WebSocket(`${scheme}://${location.host}${path}`);
  const mine = socket;
  socket.onmessage = ({ data }) => clicked(JSON.parse(data));
  socket.onclose = () => {
    if (socket === mine) {
      socket = null;
      if (openedPanel() === "register")
        setTimeout(() => {
          connect();
          sendScene();
        }, 1500);
    }
  };
}

/**
 * @param {{ picked?: { side: Side, point: Point, landmark: string | null, pair: number | null },
 *   chosen?: { pair: number, side: Side } | null, problem?: string | null }} click
 */
function clicked({ picked, chosen, problem }) {
  if (!editor || view.busy) return;
  view.missed = problem ?? null;
  if (problem) {
    draw();
    return;
  }
  if (chosen) {
    const now = editor.values.chosen;
    editor.choose(
      now?.[0] === chosen.pair && now[1] === chosen.side ? null : chosen.pair,
      chosen.side,
    );
    return;
  }
  if (picked) editor.place(picked.side, picked.point, picked.landmark, picked.pair);
}

/**
 * Request the scene with the current pairs; while one is awaited only the newest request is kept.
 */
async function sendScene() {
  if (!editor) return;
  if (sending) {
    stale = true;
    return;
  }
  sending = true;
  stale = false;
  const { pairs, mode, chosen, start, over, found } = editor.values;
  const pose =
    found?.registration.phantom_from_camera ??
    (over ? (view.fit?.phantom_from_camera ?? null) : null);
  try {
    const shown = await post(`/sessions/${pageId()}/registering`, {
      dataset: view.dataset,
      pairs: pairs.map(({ cloud, mesh }) => ({ cloud, mesh })),
      mode,
      chosen,
      pose,
      start,
      over,
      weak: weakDirections(found),
    });
    Object.assign(view, { landmarks: shown.landmarks, stated: shown.stated, cannot: null });
    if (!shown.stated && start === "stated") editor.values.start = "levelled";
  } catch (problem) {
    view.cannot = toError(problem);
  }
  sending = false;
  draw();
  if (stale) sendScene();
}

const TRANSLATIONS = ["translation along x", "translation along y", "translation along z"];
const ROTATIONS = ["rotation about x", "rotation about y", "rotation about z"];

/**
 * Return the directions that the cloud determines weakly, to be drawn as arrows.
 * @param {IcpResult | null} found
 * @returns {object[]}
 */
function weakDirections(found) {
  if (!found) return [];
  const { directions, weak_directions: texts } = found.registration;
  return directions.slice(0, Math.min(6, texts.length)).map(({ parts }, index) => ({
    translation: TRANSLATIONS.map((name) => parts[name]),
    rotation: ROTATIONS.map((name) => parts[name]),
    text: uncertainty(texts[index]),
  }));
}

/**
 * Return the uncertainty in the text for a weak direction, such as "± 1.2 mm", or "open".
 * @param {string} text
 * @returns {string}
 */
const uncertainty = (text) => {
  const match = text.match(/\+- ([\d.]+ \w+)/);
  return match ? `± ${match[1]}` : "open";
};

/** Request the rigid fit of the complete pairs, if there are three or more. */
async function fit() {
  if (!editor) return;
  const mine = ++fitRequests;
  const pairs = completePairs(editor.values.pairs);
  if (pairs.length < 3) {
    Object.assign(view, { fit: null, problem: null });
    draw();
    return;
  }
  try {
    const found = await post(`${registrationsPath()}/fit`, {
      pairs: pairs.map(({ cloud, mesh }) => ({ cloud, mesh })),
    });
    if (mine !== fitRequests) return;
    Object.assign(view, {
      fit: { ...found, of: pairs.map(({ number }) => number) },
      problem: null,
    });
  } catch (error) {
    if (mine !== fitRequests) return;
    const problem = toError(error);
    Object.assign(view, {
      fit: null,
      problem: { ...problem, message: problem.message, at: pairNumbers(problem, pairs) },
    });
  }
  draw();
  sendScene();
}

/**
 * Return the numbers in the list of the pairs that an error is about.
 * @param {ServerError} problem
 * @param {CompletePair[]} pairs
 * @returns {number[]}
 */
const pairNumbers = (problem, pairs) =>
  typeof problem.where?.pairs === "string"
    ? problem.where.pairs
        .split(",")
        .map((text) => pairs[+text - 1]?.number)
        .filter((at) => at !== undefined)
    : [];

/**
 * Refine the fit by ICP; with a name, accept the result under it.
 * @param {string | null} [accept]
 */
async function refine(accept = null) {
  if (!editor || !view.fit || view.busy) return;
  view.busy = accept ? "Keeping it …" : "Laying the cloud against phantom and table …";
  draw();
  const pairs = completePairs(editor.values.pairs).map(({ cloud, mesh }) => ({ cloud, mesh }));
  try {
    const found = await post(registrationsPath(), { pairs, accept });
    view.busy = null;
    if (accept) {
      view.accepted = accept;
      await listNames();
      draw();
    } else {
      view.accepted = null;
      editor.set({ found, over: true, chosen: null });
    }
  } catch (problem) {
    view.busy = null;
    view.refused = toError(problem);
    draw();
  }
}

/**
 * What the panel and the keys can do.
 * @type {RegisterActions}
 */
const actions = {
  choose,
  refine,
  accept: (name) => {
    view.refused = null;
    refine(name);
  },
  back: () => {
    view.refused = null;
    view.accepted = null;
    editor?.set({ found: null, over: false });
  },
  openDataset: () => view.dataset && openDatasetPanel(view.dataset),
  clear: () => editor?.put([], { mode: "cloud", chosen: null, over: false }),
  look: () => {
    post(`/sessions/${pageId()}/registering/look`).catch(toast);
  },
  landmark: (name) => editor?.place("mesh", view.landmarks[name], name),
  nudge: async (right, up) => {
    if (!editor?.values.chosen) return;
    const [number, side] = editor.values.chosen;
    const point = editor.values.pairs[number]?.[side];
    if (!point) return;
    try {
      const moved = await post(`/sessions/${pageId()}/registering/nudge`, {
        side,
        point,
        right,
        up,
      });
      editor.place(side, moved.point, null, number);
    } catch (problem) {
      toast(problem);
    }
  },
};

/** @param {KeyboardEvent} event */
const onKeyDown = (event) => {
  if (openedPanel() === "register" && editor) handleRegisterShortcut(event, editor, actions);
};

/**
 * Draw bar and panel if anything changed; a button that is replaced while it is pressed would not
 * act.
 */
function draw() {
  if (openedPanel() !== "register") return;
  const now = JSON.stringify([
    view,
    view.problem?.message,
    view.refused?.message,
    view.cannot?.message,
    editor?.values,
    editor?.canUndo(),
  ]);
  if (now === drawnState) return;
  drawnState = now;
  drawBar();
  drawPanel(box, editor, view, actions);
}

/** Draw the bar above the scene. */
function drawBar() {
  if (!editor) {
    fill(bar);
    return;
  }
  const { set, values } = editor;
  const { mode, over, start, found, pairs, chosen } = values;
  /**
   * @param {string} now
   * @param {[string, string, string][]} entries value, label and title
   * @param {(value: string) => void} act
   * @returns {HTMLElement}
   */
  const segment = (now, entries, act) =>
    element(
      "div",
      { class: "segments", role: "radiogroup" },
      entries.map(([value, label, explanation]) =>
        element(
          "button",
          {
            type: "button",
            role: "radio",
            "aria-checked": String(now === value),
            "data-value": value,
            title: explanation,
            onclick: () => act(value),
          },
          label,
        ),
      ),
    );
  fill(
    bar,
    element("span", { class: "label" }, "Clicks are for"),
    segment(
      mode,
      [
        ["cloud", "Cloud", "Key C"],
        ["mesh", "Phantom", "Key M"],
      ],
      (value) => set({ mode: value === "cloud" ? "cloud" : "mesh", chosen: null }),
    ),
    element("span", { class: "label", id: "register-hint" }, clickHint(pairs, mode, chosen)),
    element("div", { class: "spring" }),
    segment(
      String(over),
      [
        ["false", "Beside", "Cloud beside the phantom (V)"],
        ["true", "Over", "Cloud laid on the phantom (V)"],
      ],
      (value) => set({ over: value === "true" }),
    ),
    element(
      "select",
      {
        "aria-label": "How the cloud is shown before there is a fit",
        disabled: Boolean(found),
        onchange: ({ target }) => set({ start: target.value }),
      },
      /** @type {[string, string, boolean?][]} */ ([
        ["stated", "First guess as stated", !view.stated],
        ["levelled", "Levelled by its table"],
        ["camera", "As the camera sees it"],
      ]).map(([value, label, off]) =>
        element("option", { value, selected: value === start, disabled: off }, label),
      ),
    ),
    element(
      "button",
      {
        class: "icon-button",
        type: "button",
        title: "Look at all of it (R)",
        onclick: actions.look,
      },
      icon("target"),
    ),
  );
}

/**
 * Return what the next click places.
 * @param {PointPair[]} pairs
 * @param {Side} mode
 * @param {PairValues["chosen"]} chosen
 * @returns {string}
 */
function clickHint(pairs, mode, chosen) {
  const thing = ENDS[mode === "cloud" ? 1 : 0];
  if (chosen)
    return (
      `point ${chosen[0] + 1} on the ${thing}: ` +
      "click where it belongs, drag it, or move it by arrow keys"
    );
  const next = pairs.findIndex((pair) => !pair[mode]);
  return `point ${(next >= 0 ? next : pairs.length) + 1} on the ${thing}`;
}

/** Give the scene the page's light or dark theme. */
function applyTheme() {
  const inside = frame.contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = document.documentElement.dataset.theme ?? "";
}
