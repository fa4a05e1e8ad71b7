// The 3D: the viewer in its frame, and the socket that says what to show.
import * as camera from "./camera.js";
import * as capture from "./capture.js";
import { handleShortcut } from "./shortcuts.js";
import * as layers from "./layers.js";
import * as legend from "./legend.js";
import { viewRequest } from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";
import * as views from "./view-tools.js";

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
  subscribe([...SENT, "series"], () => send());
  window.addEventListener("keydown", handleShortcut);
  subscribe(["theme"], applyTheme);
  subscribe(["heading"], showNote);
  const frame = document.getElementById("viewer");
  frame.addEventListener("load", () => {
    applyTheme();
    frame.contentWindow.addEventListener("keydown", handleShortcut, true);
    for (const watch of watchers) watch(frame.contentWindow);
  });
  onViewerLoad(camera.watchCamera);
  camera.restoreCamera(page).finally(openFrame);
  connect();
}

export const pageId = () => page;

const watchers = [];

/** Call with the viewer's window each time it is opened. */
export function onViewerLoad(watch) {
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
    if (wait > 500) camera.restoreCamera(page).finally(openFrame);
    opened = true;
    wait = 500;
    busy = false;
    showNote();
    send();
  };
  socket.onmessage = ({ data }) => {
    const held = JSON.parse(data);
    busy = false;
    if (held.problem) showNote(held.problem.message);
    else {
      set({ held });
      showNote();
    }
    if (stale) send();
  };
  socket.onclose = () => {
    showNote(
      "The server does not answer. Trying again; if it was stopped, start it with: palpate serve",
    );
    wait = Math.min(opened ? 1000 : wait * 1.6, 8000);
    setTimeout(connect, wait);
  };
}

/** Ask again for what is shown, where it has changed on the server. */
export const refreshScene = () => send();

/** Ask for what is wanted now; while an answer is awaited only the newest wish is kept. */
function send() {
  if (!state().run || !state().sequence) return;
  if (busy || socket?.readyState !== WebSocket.OPEN) {
    stale = true;
    return;
  }
  busy = true;
  stale = false;
  socket.send(JSON.stringify(viewRequest()));
}

/** Words over the scene while there is nothing to see in it. */
function showNote(text = null) {
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

function applyTheme() {
  const inside = document.getElementById("viewer").contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = state().theme;
}
