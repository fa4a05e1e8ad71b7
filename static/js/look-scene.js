// The scene of a look: its viewer, the layers above it, and the legend of why points are dropped.
import { post, toError } from "./api.js";
import { byId, element, fill, icon, swatch } from "./dom.js";
import { keepFocus } from "./keep-focus.js";
import { drawReasons } from "./look-legend.js";
import { pageId } from "./scene.js";
import { subscribe, state } from "./store.js";

/** @import { Look, LookRecording, LookScene } from "./types.js" */

/** @type {Record<string, string>} */
const LAYERS = {
  raw: "Raw",
  cleaned: "Cleaned",
  tool: "Tool",
  path: "Path",
  surface: "Surface",
};
/** @type {Record<string, string>} */
const MEANINGS = {
  raw: "The cloud as it was measured",
  cleaned: "The cloud in the colours of why points are kept or dropped",
  tool: "The tool at this time",
  path: "The path of the tool",
  surface: "The phantom’s surface as it is stated",
};
/** @type {Record<string, string>} */
const INK = { raw: "raw", cleaned: "measured", tool: "tool", path: "path", surface: "extended" };
const STORED = "palpate.look-layers";
/** @type {HTMLIFrameElement} */
let frame;
/** @type {HTMLElement} */
let bar;
/** @type {HTMLElement} */
let legend;
/** @type {HTMLElement} */
let note;
/** @type {Set<string>} */
let layers = new Set(["cleaned", "tool", "path", "surface"]);
/** @type {{ id: string, look: Look, recording: LookRecording, time: number } | null} */
let wanted = null;
/** @type {LookScene | null} */
let answer = null;
/** @type {Set<string>} */
const hidden = new Set(); // reasons whose points are not drawn
let sending = false;
let stale = false; // something else is wanted since the last request

/** Create viewer, bar and legend. */
export function startLookScene() {
  try {
    layers = new Set(JSON.parse(localStorage.getItem(STORED) ?? "") ?? layers);
  } catch {
    // Nothing is stored: the layers above.
  }
  frame = element("iframe", {
    id: "look-viewer",
    title: "3D scene: clouds of the recording, tool and stated surface",
    hidden: true,
  });
  legend = element("div", { id: "look-legend", class: "legend", hidden: true });
  note = element("div", { id: "look-note", class: "scene-note", role: "status" });
  bar = element("div", {
    id: "look-bar",
    class: "look-bar",
    role: "toolbar",
    "aria-label": "Layers of the recording",
  });
  document.querySelector(".scene")?.append(frame, note, legend);
  document.querySelector(".centre")?.prepend(bar);
  frame.addEventListener("load", applyTheme);
  subscribe(["theme"], applyTheme);
}

/** Open the viewer. */
export function openLookScene() {
  if (!frame.src) frame.src = `/viser/${pageId()}-look`;
  frame.hidden = false;
  draw();
  send();
}

export function closeLookScene() {
  frame.hidden = true;
}

/**
 * Listen to keys that are pressed in the viewer.
 * @param {(event: KeyboardEvent) => void} listener
 */
export function onLookSceneKey(listener) {
  frame.addEventListener("load", () =>
    frame.contentWindow?.addEventListener("keydown", listener, true),
  );
}

/**
 * Show a recording at a time; null shows nothing.
 * @param {{ id: string, look: Look, recording: LookRecording, time: number } | null} view
 */
export function showInScene(view) {
  if (
    view?.look === wanted?.look &&
    view?.recording === wanted?.recording &&
    view?.time === wanted?.time
  )
    return;
  wanted = view;
  if (!view) answer = null;
  draw();
  send();
}

/** Request the scene; while an answer is awaited only the newest request is kept. */
async function send() {
  if (!wanted) return;
  if (sending) {
    stale = true;
    return;
  }
  sending = true;
  stale = false;
  const { id, recording, time } = wanted;
  try {
    answer = await post(`/sessions/${pageId()}/looking`, {
      look: id,
      recording: recording.name,
      time,
      layers: Object.keys(LAYERS).filter((layer) => layers.has(layer)),
      hidden: [...hidden],
    });
    note.textContent = "";
  } catch (problem) {
    answer = null;
    note.textContent = toError(problem).message;
  }
  sending = false;
  draw();
  if (stale) send();
}

/** @param {string} where */
function look(where) {
  post(`/sessions/${pageId()}/looking/view?where=${where}`).catch((problem) => {
    note.textContent = toError(problem).message;
  });
}

/**
 * Return why a layer cannot be shown; null where it can.
 * @param {string} layer
 * @returns {string | null}
 */
function unavailableReason(layer) {
  const { look: shown, recording } = wanted ?? {};
  if (!shown || !recording) return null;
  if (answer?.cannot?.[layer]) return answer.cannot[layer];
  if ((layer === "raw" || layer === "cleaned") && !recording.clouds?.t.length)
    return "This recording has no clouds that were taken";
  if ((layer === "tool" || layer === "path") && !recording.tool?.t.length)
    return "No stream is taken as the tool’s poses";
  if (layer === "surface" && !shown.setup_stated)
    return "No phantom is stated: choose a setup on the right";
  return null;
}

/**
 * Return whether a layer is drawn; a cloud that cannot be cleaned is drawn as it was measured.
 * @param {string} layer
 * @returns {boolean}
 */
const isShown = (layer) =>
  layers.has(layer) ||
  (layer === "raw" && layers.has("cleaned") && unavailableReason("cleaned") !== null);

function draw() {
  const views = { target: "reset", top: "top", front: "front", side: "side" };
  keepFocus(bar, "data-look-layer", () =>
    fill(
      bar,
      element(
        "div",
        { class: "chips", role: "group", "aria-label": "Layers" },
        Object.entries(LAYERS).map(([layer, label]) => {
          const why = unavailableReason(layer);
          return element(
            "button",
            {
              class: "chip",
              type: "button",
              disabled: why !== null,
              title: why ?? MEANINGS[layer],
              "aria-pressed": String(isShown(layer) && why === null),
              "data-look-layer": layer,
              onclick: () => toggle(layer),
            },
            swatch(INK[layer]),
            label,
          );
        }),
      ),
      element("div", { class: "spring" }),
      element(
        "div",
        { class: "chips", role: "group", "aria-label": "View" },
        Object.entries(views).map(([name, where]) =>
          element(
            "button",
            {
              class: "icon-button",
              type: "button",
              title: where === "reset" ? "Look at all of it" : `Look from the ${where}`,
              "aria-label": where === "reset" ? "Look at all of it" : `Look from the ${where}`,
              "data-look-layer": `view ${where}`,
              onclick: () => look(where),
            },
            icon(name),
          ),
        ),
      ),
    ),
  );
  note.classList.toggle("gone", !noteText());
  if (noteText()) note.textContent = noteText();
  drawLegend();
}

/** Draw the legend of the cloud that is shown. */
function drawLegend() {
  const reasons = (layers.has("cleaned") && answer?.points && wanted?.look.reasons) || [];
  drawReasons(legend, reasons, answer?.counts ?? {}, hidden, (name) => {
    if (hidden.has(name)) hidden.delete(name);
    else hidden.add(name);
    draw();
    send();
  });
}

/** @returns {string} */
function noteText() {
  if (!wanted) return "Choose recordings on the right: what they hold appears here.";
  if (!answer) return note.textContent || "Opening the scene …";
  return "";
}

/** @param {string} layer */
function toggle(layer) {
  const shown = isShown(layer);
  if (shown) layers.delete(layer);
  else layers.add(layer);
  if (shown && layer === "raw") layers.delete("cleaned");
  // The cloud is drawn once: as it was measured, or coloured by reason.
  if (layers.has(layer) && layer === "raw") layers.delete("cleaned");
  if (layers.has(layer) && layer === "cleaned") layers.delete("raw");
  localStorage.setItem(STORED, JSON.stringify([...layers]));
  draw();
  send();
}

/** Give the viewer the page's light or dark theme. */
function applyTheme() {
  const inside = byId("look-viewer", HTMLIFrameElement).contentDocument?.documentElement;
  if (inside) inside.style.colorScheme = state().theme;
}
