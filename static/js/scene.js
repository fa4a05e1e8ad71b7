// The 3D: the viewer in its frame, and the socket that says what to show.
import * as camera from "./camera.js";
import * as capture from "./capture.js";
import { onKey } from "./keys.js";
import * as layers from "./layers.js";
import * as legend from "./legend.js";
import { wish } from "./looks.js";
import { on, set, state } from "./store.js";
import * as views from "./views.js";

const SENT = [
  "run",
  "sequence",
  "frame",
  "layers",
  "colour",
  "quantity",
  "ranges",
  "limits",
  "looks",
  "side_by_side",
  "section",
  "crop",
];
const page = sessionStorage.getItem("palpate.page") ?? crypto.randomUUID();
sessionStorage.setItem("palpate.page", page);

let socket = null;
let busy = false;
let stale = false;
let wait = 500;

export function start() {
  layers.start();
  layers.startQuantity();
  legend.start();
  views.start(page);
  capture.start(page);
  on([...SENT, "series"], () => send());
  window.addEventListener("keydown", onKey);
  on(["theme"], dress);
  on(["heading"], note);
  const frame = document.getElementById("viewer");
  frame.addEventListener("load", () => {
    dress();
    frame.contentWindow.addEventListener("keydown", onKey, true);
    for (const watch of watchers) watch(frame.contentWindow);
  });
  onViewer(camera.keep);
  camera.restore(page).finally(openFrame);
  connect();
}

export const pageId = () => page;

const watchers = [];

/** Call with the viewer's window each time it is opened. */
export function onViewer(watch) {
  watchers.push(watch);
}

function openFrame() {
  document.getElementById("viewer").src = `/viser/${page}`;
}

function connect() {
  const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/sessions/${page}/socket`;
  let opened = false;
  socket = new WebSocket(address);
  socket.onopen = () => {
    if (wait > 500) camera.restore(page).finally(openFrame);
    opened = true;
    wait = 500;
    busy = false;
    note();
    send();
  };
  socket.onmessage = ({ data }) => {
    const held = JSON.parse(data);
    busy = false;
    if (held.problem) note(held.problem.message);
    else {
      set({ held });
      note();
    }
    if (stale) send();
  };
  socket.onclose = () => {
    note(
      "The server does not answer. Trying again; if it was stopped, start it with: palpate serve",
    );
    wait = Math.min(opened ? 1000 : wait * 1.6, 8000);
    setTimeout(connect, wait);
  };
}

/** Ask again for what is shown, where it has changed on the server. */
export const refresh = () => send();

/** Ask for what is wanted now; while an answer is awaited only the newest wish is kept. */
function send() {
  if (!state().run || !state().sequence) return;
  if (busy || socket?.readyState !== WebSocket.OPEN) {
    stale = true;
    return;
  }
  busy = true;
  stale = false;
  socket.send(JSON.stringify(wish()));
}

/** Words over the scene while there is nothing to see in it. */
function note(text = null) {
  const box = document.getElementById("scene-note");
  const message =
    typeof text === "string"
      ? text
      : state().run
        ? state().held
          ? ""
          : "Opening the scene …"
        : "Choose a diagnosis on the left, or start one from a dataset.";
  box.classList.toggle("gone", !message);
  if (message) box.textContent = message;
}

function dress() {
  const inside = document.getElementById("viewer").contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = state().theme;
}
