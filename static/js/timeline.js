// The timeline: playback by the wall clock, steps and slider. The scene and the plot show the
// same frame.
import { byId, element, fill, icon, swatch } from "./dom.js";
import { formatMm } from "./format.js";
import { bindShortcuts } from "./shortcuts.js";
import * as loop from "./playback-loop.js";
import { drawPlot, frameAt, frameSummary } from "./timeline-plot.js";
import { subscribe, set, state } from "./store.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

/**
 */
const RANKS = ["Worst", "Second worst", "Third worst"];
const MODEL_LABELS = { raw: "Raw", extended: "Extended", corrected: "Corrected" };
let clock = 0; // playback time [s]
let last = 0; // time of the last animation frame [ms]
/** @type {import("./timeline-plot.js").TimeScale | null} */
let timeScale = null;

/** Set buttons, slider, shortcuts and plot up. */
export function start() {
  const speeds = byId("speed", HTMLSelectElement);
  fill(
    speeds,
    SPEEDS.map((speed) =>
      element("option", { value: speed, selected: speed === state().speed }, `${speed}×`),
    ),
  );
  speeds.addEventListener("change", () => {
    set({ speed: +speeds.value });
    speeds.blur();
  });
  const buttons = {
    first: () => go(0),
    back: () => step(-1),
    play: toggle,
    forth: () => step(1),
    last: () => go(count() - 1),
  };
  for (const [name, action] of Object.entries(buttons))
    fill(name, icon(name)).addEventListener("click", action);
  const scrub = byId("scrub", HTMLInputElement);
  scrub.addEventListener("input", () => {
    set({ playing: false });
    go(+scrub.value);
  });
  /**
   * @param {KeyboardEvent} event
   * @returns {number}
   */
  const far = (event) => (event.shiftKey ? 10 : 1);
  bindShortcuts({
    " ": toggle,
    ArrowLeft: (event) => step(-far(event)),
    ArrowRight: (event) => step(far(event)),
    Home: () => step(-1e9),
    End: () => step(1e9),
  });
  bindShortcuts(
    Object.fromEntries(
      Object.entries(loop.LOOP_SHORTCUTS).map(([key, action]) => [key, () => action(count())]),
    ),
  );
  watchPlot();
  loop.start(count);
  subscribe(["playing"], ({ playing }) => {
    fill("play", icon(playing ? "pause" : "play"));
    if (playing) begin();
  });
  subscribe(["frame", "series", "theme", "palette", "loop"], draw);
  subscribe(["series", "frame"], drawWorst);
  new ResizeObserver(() => {
    draw();
    drawWorst();
  }).observe(byId("plot").parentElement ?? byId("plot"));
  draw();
}

/**
 * Return the number of frames.
 * @returns {number}
 */
const count = () => state().series?.time.length ?? 0;

/**
 * Show a frame.
 * @param {number} frame
 */
export function go(frame) {
  if (count()) set({ frame: Math.max(0, Math.min(count() - 1, frame)) });
}

/**
 * Stop and go on by some frames.
 * @param {number} by
 */
function step(by) {
  set({ playing: false });
  go(state().frame + by);
}

/** Play or pause; at the end of the played part from its start. */
function toggle() {
  if (!count()) return;
  const [from, to] = loop.playedRange(count());
  if (!state().playing && (state().frame >= to || state().frame < from)) go(from);
  set({ playing: !state().playing });
}

/** Start playback at the shown frame. */
function begin() {
  clock = state().series?.time[state().frame] ?? 0;
  last = performance.now();
  requestAnimationFrame(tick);
}

/** @param {number} now time of the animation frame [ms] */
function tick(now) {
  const { playing, speed, series } = state();
  if (!playing || !series) return;
  clock += ((now - last) / 1e3) * speed;
  last = now;
  const [from, to] = loop.playedRange(count()).map((frame) => series.time[frame]);
  if (clock >= to && state().loop && to > from) clock = from + ((clock - from) % (to - from));
  set({ frame: frameAt(series.time, Math.min(clock, to)) });
  if (clock >= to) set({ playing: false });
  else requestAnimationFrame(tick);
}

/**
 * Let the pointer choose frames in the plot, or with Shift the loop, and show the values under
 * it.
 */
function watchPlot() {
  const canvas = byId("plot", HTMLCanvasElement);
  const tip = byId("plot-tip");
  let dragging = false;
  /** @type {number | null} */
  let marked = null; // frame at which a loop is being drawn
  /**
   * @param {PointerEvent} event
   * @returns {number | null}
   */
  const frameOf = (event) => {
    const { series } = state();
    return series && timeScale ? frameAt(series.time, timeScale.timeAt(event.offsetX)) : null;
  };
  canvas.addEventListener("pointerdown", (event) => {
    const frame = frameOf(event);
    if (frame === null) return;
    dragging = true;
    canvas.setPointerCapture(event.pointerId);
    set({ playing: false });
    if (event.shiftKey) marked = frame;
    else go(frame);
  });
  canvas.addEventListener("pointermove", (event) => {
    const { series } = state();
    const frame = frameOf(event);
    if (!series || frame === null) return;
    if (dragging && marked === null) go(frame);
    if (dragging && marked !== null) loop.setLoop(marked, frame, count());
    tip.hidden = false;
    tip.textContent = [`${series.time[frame].toFixed(2)} s`, ...frameSummary(series, frame)].join(
      "\n",
    );
    const half = tip.offsetWidth / 2 + 4;
    tip.style.left = `${Math.max(half, Math.min(canvas.clientWidth - half, event.offsetX))}px`;
    tip.style.top = "2px";
  });
  canvas.addEventListener("pointerup", () => {
    dragging = false;
    marked = null;
  });
  canvas.addEventListener("pointerleave", () => {
    tip.hidden = true;
  });
}

/** Draw a button over each of the worst frames. */
function drawWorst() {
  const { series, frame } = state();
  const scale = timeScale;
  fill(
    "worst",
    series && scale
      ? series.worst.map((at, place) =>
          element(
            "button",
            {
              type: "button",
              style: { left: `${scale.timeToPixel(series.time[at])}px` },
              "aria-pressed": String(frame === at),
              "data-frame": at,
              title: `${RANKS[place]} frame, ${at + 1}: raw ${formatMm(series.distance_raw[at])}`,
              onclick: (event) => {
                set({ playing: false });
                go(at);
                event.currentTarget?.blur();
              },
            },
            String(place + 1),
          ),
        )
      : [],
  );
}

/**
 * @param {string} name of the colour
 * @param {string} label
 * @param {string} value
 * @returns {HTMLElement}
 */
const readoutEntry = (name, label, value) =>
  element(
    "span",
    { title: label },
    swatch(name, true),
    element("span", { class: "word" }, label),
    element("b", {}, value),
  );

/** Draw slider, clock, readout and plot. */
function draw() {
  const { series, frame, sequence } = state();
  const scrub = byId("scrub", HTMLInputElement);
  scrub.disabled = !series;
  scrub.max = String(Math.max(0, count() - 1));
  scrub.value = String(frame);
  const at = Math.min(frame, count() - 1);
  fill(
    "clock",
    series
      ? [
          element("strong", {}, `${series.time[at].toFixed(2)} s`),
          element("span", { class: "frames" }, ` · frame ${at + 1} of ${count()}`),
        ]
      : [sequence ? "…" : ""],
  );
  fill(
    "readout",
    series
      ? [
          ...series.models.map((name) =>
            readoutEntry(
              name,
              MODEL_LABELS[name],
              formatMm(series[`distance_${name}`]?.[at], false),
            ),
          ),
          readoutEntry("floor", "Floor", formatMm(series.noise_floor)),
        ]
      : [],
  ).classList.toggle("full", (series?.models.length ?? 0) > 2);
  timeScale = drawPlot(byId("plot", HTMLCanvasElement), series, at, loop.playedRange(count()));
}
