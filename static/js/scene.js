// The 3D scene: the viewer in its frame, and the socket that requests what it shows.
import { byId } from "./dom.js";
import * as camera from "./camera.js";
import * as capture from "./capture.js";
import { handleShortcut } from "./shortcuts.js";
import * as layers from "./layers.js";
import * as legend from "./legend.js";
import { viewRequest } from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";
import * as views from "./view-tools.js";

/** @import { State, ViewerWindow } from "./types.js" */

/**
 * Keys of the state that a request depends on.
 * @type {(keyof State)[]}
 */
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

/** @type {WebSocket | null} */
let socket = null;
let busy = false; // an answer is awaited
let stale = false; // the view has changed since the last request
let wait = 500; // before the next attempt to connect [ms]

/** Start the scene and what belongs to it. */
export function start() {
  layers.start();
  layers.startQuantity();
  legend.start();
  views.start(page);
  capture.start(page);
  subscribe([...SENT, "series"], () => send());
  window.addEventListener("keydown", handleShortcut);
  subscribe(["theme"], applyTheme);
  subscribe(["heading"], () => showNote());
  const frame = byId("viewer", HTMLIFrameElement);
  frame.addEventListener("load", () => {
    applyTheme();
    if (!frame.contentWindow) return;
    frame.contentWindow.addEventListener("keydown", handleShortcut, true);
    for (const watch of watchers) watch(frame.contentWindow);
  });
  onViewerLoad(camera.watchCamera);
  camera.restoreCamera(page).finally(openFrame);
  connect();
}

/**
 * Return the identifier of this page's session at the server.
 * @returns {string}
 */
export const pageId = () => page;

/** @type {((viewer: ViewerWindow) => void)[]} */
const watchers = [];

/**
 * Call a function with the viewer's window each time it has loaded.
 * @param {(viewer: ViewerWindow) => void} watch
 */
export function onViewerLoad(watch) {
  watchers.push(watch);
}

function openFrame() {
  byId("viewer", HTMLIFrameElement).src = `/viser/${page}`;
}

/** Open the socket, and again whenever it closes. */
function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const address = `${scheme}://${location.host}/api/sessions/${page}/socket`;
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
    const rendered = JSON.parse(data);
    busy = false;
    if (rendered.problem) showNote(rendered.problem.message);
    else {
      set({ rendered });
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

/** Request the scene again because it has changed on the server. */
export const refreshScene = () => send();

/** Request the current view; while an answer is awaited only the newest request is kept. */
function send() {
  if (!state().run || !state().sequence) return;
  if (busy || !socket || socket.readyState !== WebSocket.OPEN) {
    stale = true;
    return;
  }
  busy = true;
  stale = false;
  socket.send(JSON.stringify(viewRequest()));
}

/**
 * Show a text over the scene, or by default what is to be done while it is empty.
 * @param {string | null} [text]
 */
function showNote(text = null) {
  const box = byId("scene-note");
  const message =
    typeof text === "string"
      ? text
      : state().run
        ? state().sequence
          ? state().rendered
            ? ""
            : "Opening the scene …"
          : "No sequence of this result has clouds: what was found stands in the report."
        : "Choose a diagnosis on the left, or start one from a dataset.";
  box.classList.toggle("gone", !message);
  if (message) box.textContent = message;
}

/** Give the viewer the page's light or dark theme. */
function applyTheme() {
  const inside = byId("viewer", HTMLIFrameElement).contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = state().theme;
}
