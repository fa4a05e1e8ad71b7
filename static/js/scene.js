// The 3D: the viewer in its frame, the socket that says what to show, layer switches, colouring, legend.
import { post, toast } from "./api.js";
import { element, fill, icon, swatch } from "./dom.js";
import { scaleTower } from "./scale.js";
import { on, set, state } from "./store.js";
import { onKey } from "./timeline.js";

const LAYERS = { measured: "Measured", raw: "Raw model", extended: "Extended", tool: "Tool" };
const COLOURINGS = { plain: "Model", raw: "Raw error", extended: "Extended error" };
const page = sessionStorage.getItem("palpate.page") ?? crypto.randomUUID();
sessionStorage.setItem("palpate.page", page);

let socket = null;
let busy = false;
let stale = false;
let wait = 500;

export function start() {
  drawSwitches();
  fill("reset-view", icon("target")).addEventListener("click", () => post(`/sessions/${page}/look`).catch(toast));
  fill("crop", icon("cloud")).addEventListener("click", () => set({ crop: !state().crop }));
  on(["layers", "colour", "crop", "heading"], drawSwitches);
  on(["run", "sequence", "frame", "layers", "colour", "limit", "crop"], () => send());
  on(["colour", "limit", "held", "palette", "trial"], drawLegend);
  on(["theme"], dress);
  on(["heading"], note);
  const frame = document.getElementById("viewer");
  frame.addEventListener("load", () => { dress(); frame.contentWindow.addEventListener("keydown", onKey, true); });
  openFrame();
  connect();
}

export const pageId = () => page;

function openFrame() { document.getElementById("viewer").src = `/viser/${page}`; }

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/sessions/${page}/socket`;
  let opened = false;
  socket = new WebSocket(address);
  socket.onopen = () => {
    if (wait > 500) openFrame();
    opened = true; wait = 500; busy = false; note(); send();
  };
  socket.onmessage = ({ data }) => {
    const held = JSON.parse(data);
    busy = false;
    if (held.problem) note(held.problem.message); else { set({ held }); note(); }
    if (stale) send();
  };
  socket.onclose = () => {
    note("The server does not answer. Trying again; if it was stopped, start it with: palpate serve");
    wait = Math.min(opened ? 1000 : wait * 1.6, 8000);
    setTimeout(connect, wait);
  };
}

function send() {
  const { run, sequence, frame, layers, colour, limit, crop } = state();
  if (!run || !sequence) return;
  if (busy || socket?.readyState !== WebSocket.OPEN) { stale = true; return; }
  busy = true; stale = false;
  socket.send(JSON.stringify({ run, sequence, frame, layers, colour, limit, crop }));
}

/** Words over the scene while there is nothing to see in it. */
function note(text = null) {
  const box = document.getElementById("scene-note");
  const message = typeof text === "string" ? text : state().run ? (state().held ? "" : "Opening the scene …")
    : "Choose a diagnosis on the left, or start one from a dataset.";
  box.classList.toggle("gone", !message);
  if (message) box.textContent = message;
}

function dress() {
  const inside = document.getElementById("viewer").contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = state().theme;
}

function drawSwitches() {
  const { layers, colour, crop } = state();
  const absent = state().heading && !state().heading.has_clouds;
  fill("layers", Object.entries(LAYERS).map(([name, label]) => element("button", {
    class: "chip", type: "button", disabled: absent && name === "measured",
    title: absent && name === "measured" ? "The dataset is not where this run says, so its clouds cannot be shown" : null, "aria-pressed": String(layers.includes(name)), "data-layer": name,
    onclick: () => set({ layers: Object.keys(LAYERS).filter((key) => state().layers.includes(key) !== (key === name)) }),
  }, swatch(name), label)));
  fill("colouring", Object.entries(COLOURINGS).map(([name, label]) => element("button", {
    type: "button", role: "radio", "aria-checked": String(colour === name), "data-colour": name,
    title: name === "plain" ? "Each model in its own colour" : `Measured surface minus ${name} model`,
    onclick: () => choose(name),
  }, label)));
  document.getElementById("crop").setAttribute("aria-pressed", String(!crop));
}

function choose(colour) {
  const layers = colour === "plain" || state().layers.includes(colour) ? state().layers : [...state().layers, colour];
  set({ colour, layers });
}

function drawLegend() {
  const { held, palette, limit, colour, trial } = state();
  const box = document.getElementById("legend");
  const shown = held?.drawn?.limit ?? null;
  box.hidden = !palette || shown === null || colour === "plain";
  if (box.hidden || box.contains(document.activeElement) && document.activeElement.type === "number") return;
  const fixed = limit !== null;
  fill(box,
    element("div", { class: "title" }, "Measured −", element("br"), `${trial && colour === "extended" ? "what if" : `${colour} model`}, mm`),
    element("div", { class: "ends" }, "measured higher"),
    scaleTower(palette.signed, shown),
    element("div", { class: "ends" }, "measured deeper"),
    element("div", { class: "range" },
      element("div", { class: "segments" },
        element("button", { type: "button", role: "radio", "aria-checked": String(!fixed), title: "Holds 95 % of the raw model's errors in this sequence", onclick: () => set({ limit: null }) }, "Auto"),
        element("button", { type: "button", role: "radio", "aria-checked": String(fixed), onclick: () => set({ limit: shown }) }, "Fixed")),
      fixed ? element("label", {}, "± ", element("input", { type: "number", min: 0.05, max: 20, step: 0.05, value: +(limit * 1e3).toFixed(3), "aria-label": "End of the scale in mm", title: "End of the scale in mm",
        onchange: (event) => { const value = +event.target.value; event.target.blur(); if (value > 0 && value <= 1000) set({ limit: value / 1e3 }); } })) : null),
    element("div", { class: "unseen" }, swatch("unseen"), "not seen"));
}
