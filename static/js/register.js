// Registration by hand: points clicked on cloud and phantom, a fit from three pairs on, ICP from there, accepted under a name or not.
import { get, post, title, toast } from "./api.js";
import { element, fill, icon } from "./dom.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { drawPanel } from "./register-panel.js";
import { lastDataset, whole, workOn } from "./register-state.js";
import { pageId } from "./scene.js";
import { onKeys } from "./register-keys.js";

const ENDS = ["phantom", "cloud"];
let box = null;
let frame = null;
let bar = null;
let work = null;
let socket = null;
let view = null; // what the panel shows beside the pairs: datasets, fit, problem, busy, names, landmarks
let asked = 0;
let showing = false;
let drawn = null;
let stale = false;

let openDatasetOf = null;

export function startRegister(openDataset) {
  openDatasetOf = openDataset;
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
    dress();
    frame.contentWindow?.addEventListener("keydown", keys, true);
  });
  window.addEventListener("keydown", keys, true);
}

/** Bring the panel to the front on one dataset. */
export function registerByHand(dataset) {
  choose(dataset).catch(toast);
  openPanel("register");
}

/** A choice of how the camera is registered: automatically, or as somebody accepted it; hidden where there is no choice. */
export async function cameraChoice(dataset) {
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
  drawn = null;
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
    fill(box, broken(problem));
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
  if (view.dataset !== dataset || !work) {
    Object.assign(view, { dataset, fit: null, problem: null, names: [] });
    work = workOn(dataset, (others) => {
      draw();
      show();
      if (others) fit();
    });
    work.set({ chosen: null });
    fit();
  }
  draw();
  show();
  await listNames();
}

async function listNames() {
  const { registrations } = await get(`${address()}`);
  view.names = registrations;
  draw();
}

const address = () => `/datasets/${encodeURIComponent(view.dataset)}/registrations`;

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
          show();
        }, 1500);
    }
  };
}

function clicked({ picked, chosen, problem }) {
  if (!work || view.busy) return;
  view.missed = problem ?? null;
  if (problem) {
    draw();
    return;
  }
  if (chosen) {
    const now = work.values.chosen;
    work.choose(
      now?.[0] === chosen.pair && now[1] === chosen.side ? null : chosen.pair,
      chosen.side,
    );
    return;
  }
  work.place(picked.side, picked.point, picked.landmark, picked.pair);
}

/** Have the scene show what is here; while it is being drawn only the newest is kept. */
async function show() {
  if (showing) {
    stale = true;
    return;
  }
  showing = true;
  stale = false;
  const { pairs, mode, chosen, start, over, found } = work.values;
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
      weak: weak(found),
    });
    Object.assign(view, { landmarks: held.landmarks, stated: held.stated, cannot: null });
    if (!held.stated && start === "stated") work.values.start = "levelled";
  } catch (problem) {
    view.cannot = problem;
  }
  showing = false;
  draw();
  if (stale) show();
}

const MOTIONS = ["translation along x", "translation along y", "translation along z"];
const TURNS = ["rotation about x", "rotation about y", "rotation about z"];

/** The directions that the cloud determines weakly, as arrows. */
function weak(found) {
  return (found?.registration.directions ?? [])
    .slice(0, found?.registration.weak_directions.length ?? 0)
    .slice(0, 6)
    .map(({ parts }, at) => ({
      translation: MOTIONS.map((name) => parts[name]),
      rotation: TURNS.map((name) => parts[name]),
      text: amount(found.registration.weak_directions[at]),
    }));
}

/** "± 1.2 mm" of the words for a weak direction, or that it is open. */
const amount = (text) =>
  /\+- ([\d.]+ \w+)/.test(text) ? `± ${text.match(/\+- ([\d.]+ \w+)/)[1]}` : "open";

/** The rigid fit of the whole pairs, or why there is none yet. */
async function fit() {
  const mine = ++asked;
  const pairs = whole(work.values.pairs);
  if (pairs.length < 3) {
    Object.assign(view, { fit: null, problem: null });
    draw();
    return;
  }
  try {
    const found = await post(`${address()}/fit`, {
      pairs: pairs.map(({ cloud, mesh }) => ({ cloud, mesh })),
    });
    if (mine !== asked) return;
    Object.assign(view, {
      fit: { ...found, of: pairs.map(({ number }) => number) },
      problem: null,
    });
  } catch (problem) {
    if (mine !== asked) return;
    Object.assign(view, {
      fit: null,
      problem: { ...problem, message: problem.message, at: numbers(problem, pairs) },
    });
  }
  draw();
  show();
}

/** Which pairs a refusal speaks of, as numbered in the list. */
const numbers = (problem, pairs) =>
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
  const pairs = whole(work.values.pairs).map(({ cloud, mesh }) => ({ cloud, mesh }));
  try {
    const found = await post(address(), { pairs, accept });
    view.busy = null;
    if (accept) {
      view.accepted = accept;
      await listNames();
      draw();
    } else {
      view.accepted = null;
      work.set({ found, over: true, chosen: null });
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
    work.set({ found: null, over: false });
  },
  openDataset: () => openDatasetOf?.(view.dataset),
  clear: () => work.put([], { mode: "cloud", chosen: null, over: false }),
  look: () => post(`/sessions/${pageId()}/registering/look`).catch(toast),
  landmark: (name) => work.place("mesh", view.landmarks[name], name),
  nudge: async (right, up) => {
    const [number, side] = work.values.chosen ?? [];
    const point = work.values.pairs[number]?.[side];
    if (!point) return;
    try {
      const moved = (
        await post(`/sessions/${pageId()}/registering/nudge`, { side, point, right, up })
      ).point;
      work.place(side, moved, null, number);
    } catch (problem) {
      toast(problem);
    }
  },
};

const keys = (event) => {
  if (openedPanel() === "register" && work) onKeys(event, work, actions);
};

/** The panel anew, where anything changed: a button that is replaced while it is pressed would do nothing. */
function draw() {
  if (!view || openedPanel() !== "register") return;
  const now = JSON.stringify([
    view,
    view.problem?.message,
    view.refused?.message,
    view.cannot?.message,
    work?.values,
    work?.canUndo(),
  ]);
  if (now === drawn) return;
  drawn = now;
  drawBar();
  drawPanel(box, work, view, actions);
}

function drawBar() {
  if (!work) {
    fill(bar);
    return;
  }
  const { mode, over, start, found, pairs } = work.values;
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
      (value) => work.set({ mode: value, chosen: null }),
    ),
    element("span", { class: "label", id: "register-hint" }, hint(pairs, mode, work.values.chosen)),
    element("div", { class: "spring" }),
    segment(
      String(over),
      [
        ["false", "Beside", "Cloud beside the phantom (V)"],
        ["true", "Over", "Cloud laid on the phantom (V)"],
      ],
      (value) => work.set({ over: value === "true" }),
    ),
    element(
      "select",
      {
        "aria-label": "How the cloud is shown before there is a fit",
        disabled: Boolean(found),
        onchange: ({ target }) => work.set({ start: target.value }),
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

function hint(pairs, mode, chosen) {
  const thing = ENDS[mode === "cloud" ? 1 : 0];
  if (chosen)
    return `point ${chosen[0] + 1} on the ${thing}: click where it belongs, drag it, or move it by arrow keys`;
  const open = pairs.findIndex((pair) => !pair[mode]);
  return `point ${(open >= 0 ? open : pairs.length) + 1} on the ${thing}`;
}

function dress() {
  const inside = frame.contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = document.documentElement.dataset.theme;
}

const broken = (problem) =>
  element(
    "div",
    { class: "note-card bad", role: "alert" },
    element("strong", {}, title(problem)),
    problem.message,
  );
