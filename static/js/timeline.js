// Time: play by the wall clock, step, scrub; one cursor for scene and plot.
import { element, fill, icon, swatch } from "./dom.js";
import { mm } from "./format.js";
import { drawPlot, frameAt } from "./plot.js";
import { on, set, state } from "./store.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
let clock = 0;
let last = 0;

export function start() {
  fill("speed", SPEEDS.map((speed) => element("option", { value: speed, selected: speed === state().speed }, `${speed}×`)))
    .addEventListener("change", (event) => { set({ speed: +event.target.value }); event.target.blur(); });
  const buttons = { first: () => go(0), back: () => step(-1), play: toggle, forth: () => step(1), last: () => go(count() - 1) };
  for (const [name, action] of Object.entries(buttons)) fill(name, icon(name)).addEventListener("click", action);
  const scrub = document.getElementById("scrub");
  scrub.addEventListener("input", () => { set({ playing: false }); go(+scrub.value); });
  window.addEventListener("keydown", onKey);
  watchPlot();
  on(["playing"], ({ playing }) => { fill("play", icon(playing ? "pause" : "play")); if (playing) begin(); });
  on(["frame", "series", "theme", "palette"], draw);
  new ResizeObserver(draw).observe(document.getElementById("plot").parentElement);
  draw();
}

const count = () => state().series?.time.length ?? 0;

export function go(frame) { if (count()) set({ frame: Math.max(0, Math.min(count() - 1, frame)) }); }

function step(by) { set({ playing: false }); go(state().frame + by); }

function toggle() {
  if (!count()) return;
  if (!state().playing && state().frame >= count() - 1) go(0);
  set({ playing: !state().playing });
}

export function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target?.matches?.("input:not([type=range]), select, textarea");
  const pressing = event.key === " " && event.target?.matches?.("button");
  if (typing || pressing || document.getElementById("enlarged").open) return;
  const far = event.shiftKey ? 10 : 1;
  const actions = { " ": toggle, ArrowLeft: () => step(-far), ArrowRight: () => step(far), Home: () => step(-1e9), End: () => step(1e9) };
  if (!(event.key in actions)) return;
  event.preventDefault(); event.stopPropagation();
  actions[event.key]();
}

function begin() {
  clock = state().series.time[state().frame];
  last = performance.now();
  requestAnimationFrame(tick);
}

function tick(now) {
  const { playing, speed, series } = state();
  if (!playing || !series) return;
  clock += (now - last) / 1e3 * speed;
  last = now;
  const end = series.time[series.time.length - 1];
  set({ frame: frameAt(series.time, Math.min(clock, end)) });
  if (clock >= end) set({ playing: false }); else requestAnimationFrame(tick);
}

function watchPlot() {
  const canvas = document.getElementById("plot");
  const tip = document.getElementById("plot-tip");
  let dragging = false;
  const frameOf = (event) => frameAt(state().series.time, canvas.timeAt(event.offsetX));
  canvas.addEventListener("pointerdown", (event) => {
    if (!count()) return;
    dragging = true; canvas.setPointerCapture(event.pointerId); set({ playing: false }); go(frameOf(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!count()) return;
    const frame = frameOf(event);
    if (dragging) go(frame);
    const { series } = state();
    tip.hidden = false;
    tip.textContent = `${series.time[frame].toFixed(2)} s   raw ${mm(series.distance_raw[frame])}   extended ${mm(series.distance_extended[frame])}`;
    const half = tip.offsetWidth / 2 + 4;
    tip.style.left = `${Math.max(half, Math.min(canvas.clientWidth - half, event.offsetX))}px`;
    tip.style.top = "2px";
  });
  canvas.addEventListener("pointerup", () => { dragging = false; });
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
}

function draw() {
  const { series, frame, sequence } = state();
  const scrub = document.getElementById("scrub");
  scrub.disabled = !series;
  scrub.max = Math.max(0, count() - 1);
  scrub.value = frame;
  const at = Math.min(frame, count() - 1);
  fill("clock", series ? [element("strong", {}, `${series.time[at].toFixed(2)} s`), element("span", { class: "frames" }, ` · frame ${at + 1} of ${count()}`)] : [sequence ? "…" : ""]);
  fill("readout", series ? [
    element("span", {}, swatch("raw", true), "Raw", element("b", {}, mm(series.distance_raw[at], false))),
    element("span", {}, swatch("extended", true), "Extended", element("b", {}, mm(series.distance_extended[at], false))),
    element("span", {}, swatch("floor", true), "Floor", element("b", {}, mm(series.noise_floor)))] : []);
  drawPlot(document.getElementById("plot"), series, at);
}
