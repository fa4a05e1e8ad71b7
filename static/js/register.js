// Registration by hand: points clicked on cloud and phantom, a fit from three pairs on, ICP from there, accepted under a name or not.
import { get, post, errorTitle, toast } from "./api.js";
import { element, fill, icon } from "./dom.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { drawPanel } from "./register-panel.js";
import { lastDataset, completePairs, createPairEditor } from "./register-pairs.js";
import { pageId } from "./scene.js";
import { handleRegisterShortcut } from "./register-shortcuts.js";

const ENDS = ["phantom", "cloud"];
let box = null;
let frame = null;
let bar = null;
let editor = null;
let socket = null;
let view = null; // what the panel shows beside the pairs: datasets, fit, problem, busy, names, landmarks
let fitRequests = 0;
let sending = false;
let drawnState = null;
let stale = false;

let openDatasetPanel = null;

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
  document.querySelector(".scene").append(frame);
  document.querySelector(".centre").prepend(bar);
  frame.addEventListener("load", () => {
    applyTheme();
    frame.contentWindow?.addEventListener("keydown", onKeyDown, true);
  });
  window.addEventListener("keydown", onKeyDown, true);
}

/** Bring the panel to the front on one dataset. */
export function openRegistration(dataset) {
  choose(dataset).catch(toast);
  openPanel("register");
}

/** A choice of how the camera is registered: automatically, or as somebody accepted it; hidden where there is no choice. */
export async function cameraSelect(dataset) {
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

async function open() {
  drawnState = null;
  document.body.classList.add("registering");
  if (!frame.src) frame.src = `/viser/${pageId()}-register`;
  frame.hidden = false;
  connect();
  try {
    const { datasets, folder } = await get("/datasets");
    view = {
      datasets,
      folder,
      fit: null,
      problem: null,
      busy: null,
      names: [],
      landmarks: {},
      stated: true,
      ...view,
      datasets,
    };
    const dataset =
      view.dataset ?? [lastDataset(), datasets[0]].find((name) => datasets.includes(name));
    if (dataset) await choose(dataset);
    else draw();
  } catch (problem) {
    fill(box, errorCard(problem));
  }
}

function leave() {
  document.body.classList.remove("registering");
  frame.hidden = true;
  socket?.close();
  socket = null;
}

async function choose(dataset) {
  if (!view)
    view = {
      datasets: [],
      fit: null,
      problem: null,
      busy: null,
      names: [],
      landmarks: {},
      stated: true,
    };
  if (view.dataset !== dataset || !editor) {
    Object.assign(view, { dataset, fit: null, problem: null, names: [] });
    editor = createPairEditor(dataset, (others) => {
      draw();
      sendScene();
      if (others) fit();
    });
    editor.set({ chosen: null });
    fit();
  }
  draw();
  sendScene();
  await listNames();
}

async function listNames() {
  const { registrations } = await get(`${registrationsPath()}`);
  view.names = registrations;
  draw();
}

const registrationsPath = () => `/datasets/${encodeURIComponent(view.dataset)}/registrations`;

/** Each click in the scene comes as the point that it means. */
function connect() {
  if (socket) return;
  socket = new WebSocket(
    `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/sessions/${pageId()}/registering/clicks`,
  );
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
  editor.place(picked.side, picked.point, picked.landmark, picked.pair);
}

/** Have the scene show what is here; while it is being drawn only the newest is kept. */
async function sendScene() {
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
    const held = await post(`/sessions/${pageId()}/registering`, {
      dataset: view.dataset,
      pairs: pairs.map(({ cloud, mesh }) => ({ cloud, mesh })),
      mode,
      chosen,
      pose,
      start,
      over,
      weak: weakDirections(found),
    });
    Object.assign(view, { landmarks: held.landmarks, stated: held.stated, cannot: null });
    if (!held.stated && start === "stated") editor.values.start = "levelled";
  } catch (problem) {
    view.cannot = problem;
  }
  sending = false;
  draw();
  if (stale) sendScene();
}

const TRANSLATIONS = ["translation along x", "translation along y", "translation along z"];
const ROTATIONS = ["rotation about x", "rotation about y", "rotation about z"];

/** The directions that the cloud determines weakly, as arrows. */
function weakDirections(found) {
  return (found?.registration.directions ?? [])
    .slice(0, found?.registration.weak_directions.length ?? 0)
    .slice(0, 6)
    .map(({ parts }, at) => ({
      translation: TRANSLATIONS.map((name) => parts[name]),
      rotation: ROTATIONS.map((name) => parts[name]),
      text: uncertainty(found.registration.weak_directions[at]),
    }));
}

/** "± 1.2 mm" of the words for a weak direction, or that it is open. */
const uncertainty = (text) =>
  /\+- ([\d.]+ \w+)/.test(text) ? `± ${text.match(/\+- ([\d.]+ \w+)/)[1]}` : "open";

/** The rigid fit of the whole pairs, or why there is none yet. */
async function fit() {
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
  } catch (problem) {
    if (mine !== fitRequests) return;
    Object.assign(view, {
      fit: null,
      problem: { ...problem, message: problem.message, at: pairNumbers(problem, pairs) },
    });
  }
  draw();
  sendScene();
}

/** Which pairs a refusal speaks of, as numbered in the list. */
const pairNumbers = (problem, pairs) =>
  typeof problem.where?.pairs === "string"
    ? problem.where.pairs
        .split(",")
        .map((text) => pairs[+text - 1]?.number)
        .filter((at) => at !== undefined)
    : [];

async function refine(accept = null) {
  if (!view.fit || view.busy) return;
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
    view.refused = problem;
    draw();
  }
}

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
    editor.set({ found: null, over: false });
  },
  openDataset: () => openDatasetPanel?.(view.dataset),
  clear: () => editor.put([], { mode: "cloud", chosen: null, over: false }),
  look: () => post(`/sessions/${pageId()}/registering/look`).catch(toast),
  landmark: (name) => editor.place("mesh", view.landmarks[name], name),
  nudge: async (right, up) => {
    const [number, side] = editor.values.chosen ?? [];
    const point = editor.values.pairs[number]?.[side];
    if (!point) return;
    try {
      const moved = (
        await post(`/sessions/${pageId()}/registering/nudge`, { side, point, right, up })
      ).point;
      editor.place(side, moved, null, number);
    } catch (problem) {
      toast(problem);
    }
  },
};

const onKeyDown = (event) => {
  if (openedPanel() === "register" && editor) handleRegisterShortcut(event, editor, actions);
};

/** The panel anew, where anything changed: a button that is replaced while it is pressed would do nothing. */
function draw() {
  if (!view || openedPanel() !== "register") return;
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

function drawBar() {
  if (!editor) {
    fill(bar);
    return;
  }
  const { mode, over, start, found, pairs } = editor.values;
  const segment = (now, entries, act) =>
    element(
      "div",
      { class: "segments", role: "radiogroup" },
      entries.map(([value, label, hint, off]) =>
        element(
          "button",
          {
            type: "button",
            role: "radio",
            "aria-checked": String(now === value),
            "data-value": value,
            title: hint,
            disabled: off,
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
      (value) => editor.set({ mode: value, chosen: null }),
    ),
    element(
      "span",
      { class: "label", id: "register-hint" },
      clickHint(pairs, mode, editor.values.chosen),
    ),
    element("div", { class: "spring" }),
    segment(
      String(over),
      [
        ["false", "Beside", "Cloud beside the phantom (V)"],
        ["true", "Over", "Cloud laid on the phantom (V)"],
      ],
      (value) => editor.set({ over: value === "true" }),
    ),
    element(
      "select",
      {
        "aria-label": "How the cloud is shown before there is a fit",
        disabled: Boolean(found),
        onchange: ({ target }) => editor.set({ start: target.value }),
      },
      [
        ["stated", "First guess as stated", !view.stated],
        ["levelled", "Levelled by its table"],
        ["camera", "As the camera sees it"],
      ].map(([value, label, off]) =>
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

function clickHint(pairs, mode, chosen) {
  const thing = ENDS[mode === "cloud" ? 1 : 0];
  if (chosen)
    return `point ${chosen[0] + 1} on the ${thing}: click where it belongs, drag it, or move it by arrow keys`;
  const open = pairs.findIndex((pair) => !pair[mode]);
  return `point ${(open >= 0 ? open : pairs.length) + 1} on the ${thing}`;
}

function applyTheme() {
  const inside = frame.contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = document.documentElement.dataset.theme;
}

const errorCard = (problem) =>
  element(
    "div",
    { class: "note-card bad", role: "alert" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );
