// The timeline of a look below the scene: buttons, canvas, what is read at the cursor, and the part
// of the recording in sight.
import { element } from "./dom.js";
import { handleTimelineKey } from "./look-timeline-keys.js";
import { drawLookTimeline } from "./look-timeline-plot.js";
import { KINDS, nearest, summaryAt } from "./look-timeline-readings.js";
import { drawTools } from "./look-timeline-tools.js";
import { watchPointer } from "./look-timeline-pointer.js";
import { subscribe } from "./store.js";

/** @import { TimelineHost } from "./look-timeline-tools.js" */
/** @import { LookRecording, LookScale } from "./types.js" */

const CLOSEST = 0.5; // part of a recording that fills the timeline at most [s]
const NEW_LENGTH = 4; // of a sequence that is added by key [s]

/** @type {TimelineHost} */
let host;
/** @type {HTMLCanvasElement} */
let canvas;
/** @type {HTMLElement} */
let tools;
/** @type {HTMLElement} */
let tip;
/** @type {HTMLElement} */
let spoken;
/** @type {[number, number]} */
let view = [0, 1];
/** @type {string | null} */
let shownRecording = null;
/** @type {LookScale | null} */
let scale = null;
/** @type {[number, number] | null} */
let drawn = null;

/**
 * Create the timeline below the scene.
 * @param {TimelineHost} given
 */
export function startLookTimeline(given) {
  host = given;
  tools = element("div", { class: "transport", role: "toolbar", "aria-label": "Cutting" });
  canvas = element("canvas", {
    id: "look-plot",
    tabindex: "0",
    role: "application",
    "aria-label": "Timeline of the recording",
    "aria-describedby": "look-keys",
  });
  tip = element("div", { class: "tip", hidden: true });
  spoken = element("div", { class: "unseen-text", role: "status", "aria-live": "polite" });
  const box = element(
    "section",
    { id: "look-timeline", class: "look-timeline", "aria-label": "Timeline of the recording" },
    tools,
    element("div", { class: "plot" }, canvas, tip),
    spoken,
    element(
      "p",
      { class: "unseen-text", id: "look-keys" },
      "Arrow keys move the cursor, plus and minus zoom, comma and full stop choose a sequence, " +
        "I and O set its start and end, S splits it, N adds one, Delete removes it.",
    ),
  );
  document.querySelector(".centre")?.append(box);
  watchPointer(canvas, {
    scale: () => scale,
    editor: () => host.editor(),
    recording: () => host.recording(),
    goTo: (time) => host.goTo(time),
    zoom,
    pan,
    hover,
    draw: (ends) => {
      drawn = ends;
      drawTimeline();
    },
  });
  new ResizeObserver(drawTimeline).observe(canvas.parentElement ?? canvas);
  subscribe(["theme"], drawTimeline);
}

/** Draw buttons and canvas. */
export function drawTimeline() {
  const recording = host.recording();
  if (!recording || !canvas.isConnected || !canvas.parentElement?.clientWidth) return;
  if (shownRecording !== recording.name) {
    shownRecording = recording.name;
    fit();
  }
  view = within(view, recording);
  const editor = host.editor();
  scale = drawLookTimeline(canvas, {
    recording,
    view,
    cursor: host.time(),
    sequences: host.sequences(recording.name),
    selected: editor?.selected ?? null,
    drawn,
  });
  drawTools(tools, host, acts, recording);
}

/** Show all of the next recording, even one of the same name. */
export function forgetView() {
  shownRecording = null;
}

/**
 * Return a time counted from the start of the recording, as text.
 * @param {number} time
 * @returns {string}
 */
const relative = (time) => (time - (host.recording()?.start ?? 0)).toFixed(2);

function fit() {
  const recording = host.recording();
  if (recording) view = [recording.start, Math.max(recording.end, recording.start + CLOSEST)];
}

/**
 * Return a view moved and shortened so that it lies in the recording.
 * @param {[number, number]} wanted
 * @param {LookRecording} recording
 * @returns {[number, number]}
 */
function within([from, to], { start, end }) {
  const last = Math.max(end, start + CLOSEST);
  const length = Math.min(last - start, Math.max(CLOSEST, to - from));
  const first = Math.max(start, Math.min(last - length, from));
  return [first, first + length];
}

/**
 * Show `factor` times as much; what is at the time stays where it is.
 * @param {number} factor
 * @param {number} [time]
 */
function zoom(factor, time = host.time()) {
  const recording = host.recording();
  if (!recording) return;
  const [from, to] = view;
  const held = time < from || time > to ? (from + to) / 2 : time;
  const length = Math.max(CLOSEST, Math.min(recording.end - recording.start, (to - from) * factor));
  const first = held - ((held - from) / (to - from)) * length;
  view = [first, first + length];
  drawTimeline();
}

/** @param {number} seconds */
function pan(seconds) {
  view = [view[0] + seconds, view[1] + seconds];
  drawTimeline();
}

/**
 * Show what is under the pointer; null where there is none.
 * @param {{ time: number, x: number, near: number } | null} at
 */
function hover(at) {
  const recording = host.recording();
  tip.hidden = !at || !recording;
  if (!at || !recording) return;
  const sequences = host.sequences(recording.name);
  tip.textContent = [
    `${relative(at.time)} s`,
    ...summaryAt(recording, sequences, at.time, at.near),
  ].join("\n");
  const half = tip.offsetWidth / 2 + 4;
  tip.style.left = `${Math.max(half, Math.min(canvas.clientWidth - half, at.x))}px`;
  tip.style.top = "2px";
}

/**
 * Move the cursor by some stored clouds; without clouds by hundredths of what is in sight.
 * @param {number} by
 */
function step(by) {
  const recording = host.recording();
  if (!recording) return;
  const { t, shown } = recording.clouds ?? { t: [], shown: [] };
  const times = shown.map((at) => t[at]);
  const time = host.time();
  let next = time + (by * (view[1] - view[0])) / 100;
  if (times.length) {
    const at = nearest(times, time);
    const towards = by > 0 ? times[at] > time + 1e-6 : times[at] < time - 1e-6;
    const index = towards ? at + by - Math.sign(by) : at + by;
    next = times[Math.max(0, Math.min(times.length - 1, index))];
  }
  show(Math.max(recording.start, Math.min(recording.end, next)));
}

/**
 * Move the cursor, and the view where the cursor would leave it.
 * @param {number} time
 */
function show(time) {
  const [from, to] = view;
  if (time < from || time > to) view = [time - (to - from) / 2, time + (to - from) / 2];
  host.goTo(time);
  speak(`${relative(time)} seconds`);
}

/** @param {string} text */
function speak(text) {
  spoken.textContent = text;
}

function addHere() {
  const recording = host.recording();
  if (recording) host.editor()?.add(recording.name, host.time(), host.time() + NEW_LENGTH);
}

function splitHere() {
  const chosen = host.editor()?.chosen();
  if (chosen) host.editor()?.split(chosen.key, host.time());
}

function removeChosen() {
  const chosen = host.editor()?.chosen();
  if (chosen) host.editor()?.remove(chosen.key);
}

/**
 * Choose the next sequence of the recording, and bring it into sight.
 * @param {number} by
 */
function chooseNeighbour(by) {
  const recording = host.recording();
  const editor = host.editor();
  if (!recording || !editor) return;
  editor.neighbour(recording.name, by);
  const chosen = editor.chosen();
  if (!chosen) return;
  show(chosen.start);
  speak(
    `${chosen.name}, ${KINDS[chosen.kind ?? ""]}, ${relative(chosen.start)} to ` +
      `${relative(chosen.end)} seconds`,
  );
}

/** What buttons and keys do. */
const acts = {
  step,
  show,
  zoom: (/** @type {number} */ factor) => zoom(factor),
  fit: () => {
    fit();
    drawTimeline();
  },
  add: addHere,
  split: splitHere,
  remove: removeChosen,
  choose: chooseNeighbour,
};

/**
 * Run the action of a pressed key.
 * @param {KeyboardEvent} event
 * @returns {boolean} whether the key has one
 */
export const pressKey = (event) => handleTimelineKey(event, host, acts);
