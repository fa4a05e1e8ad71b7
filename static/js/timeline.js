// Time: play by the wall clock, step, scrub; one cursor for scene and plot.
import { element, fill, icon, swatch } from "./dom.js";
import { formatMm } from "./format.js";
import { bindShortcuts } from "./shortcuts.js";
import * as loop from "./playback-loop.js";
import { drawPlot, frameAt, frameSummary } from "./timeline-plot.js";
import { subscribe, set, state } from "./store.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const MODEL_LABELS = { raw: "Raw", extended: "Extended", corrected: "Corrected" };
let clock = 0;
let last = 0;

export function start() {
  fill(
    "speed",
    SPEEDS.map((speed) =>
      element("option", { value: speed, selected: speed === state().speed }, `${speed}×`),
    ),
  ).addEventListener("change", (event) => {
    set({ speed: +event.target.value });
    event.target.blur();
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
  const scrub = document.getElementById("scrub");
  scrub.addEventListener("input", () => {
    set({ playing: false });
    go(+scrub.value);
  });
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
  }).observe(document.getElementById("plot").parentElement);
  draw();
}

const count = () => state().series?.time.length ?? 0;

export function go(frame) {
  if (count()) set({ frame: Math.max(0, Math.min(count() - 1, frame)) });
}

function step(by) {
  set({ playing: false });
  go(state().frame + by);
}

function toggle() {
  if (!count()) return;
  const [from, to] = loop.playedRange(count());
  if (!state().playing && (state().frame >= to || state().frame < from)) go(from);
  set({ playing: !state().playing });
}

function begin() {
  clock = state().series.time[state().frame];
  last = performance.now();
  requestAnimationFrame(tick);
}

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

function watchPlot() {
  const canvas = document.getElementById("plot");
  const tip = document.getElementById("plot-tip");
  let dragging = false;
  let marked = null;
  const frameOf = (event) => frameAt(state().series.time, canvas.timeAt(event.offsetX));
  canvas.addEventListener("pointerdown", (event) => {
    if (!count()) return;
    dragging = true;
    canvas.setPointerCapture(event.pointerId);
    set({ playing: false });
    if (event.shiftKey) marked = frameOf(event);
    else go(frameOf(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!count()) return;
    const frame = frameOf(event);
    if (dragging && marked === null) go(frame);
    if (dragging && marked !== null) loop.setLoop(marked, frame, count());
    const { series } = state();
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

/** A button over each of the worst frames. */
function drawWorst() {
  const { series, frame } = state();
  const canvas = document.getElementById("plot");
  fill(
    "worst",
    series && canvas.timeToPixel
      ? series.worst.map((at, place) =>
          element(
            "button",
            {
              type: "button",
              style: { left: `${canvas.timeToPixel(series.time[at])}px` },
              "aria-pressed": String(frame === at),
              "data-frame": at,
              title: `${["Worst", "Second worst", "Third worst"][place]} frame, ${at + 1}: raw ${formatMm(series.distance_raw[at])}`,
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

const readoutEntry = (thing, label, value) =>
  element(
    "span",
    { title: label },
    swatch(thing, true),
    element("span", { class: "word" }, label),
    element("b", {}, value),
  );

function draw() {
  const { series, frame, sequence } = state();
  const scrub = document.getElementById("scrub");
  scrub.disabled = !series;
  scrub.max = Math.max(0, count() - 1);
  scrub.value = frame;
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
            readoutEntry(name, MODEL_LABELS[name], formatMm(series[`distance_${name}`][at], false)),
          ),
          readoutEntry("floor", "Floor", formatMm(series.noise_floor)),
        ]
      : [],
  ).classList.toggle("full", (series?.models.length ?? 0) > 2);
  drawPlot(document.getElementById("plot"), series, at, loop.playedRange(count()));
}
