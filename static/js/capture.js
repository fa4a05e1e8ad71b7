// Pictures of the scene for download: a still as PNG, a sequence or its looped part as GIF,
// with legend and caption.
import { GIFEncoder, applyPalette, quantize } from "../vendor/gifenc/gifenc.esm.js";
import { ApiError, toast, toError } from "./api.js";
import { byId, element, fill } from "./dom.js";
import { formatMm } from "./format.js";
import { legendContent } from "./legend.js";
import { playedRange } from "./playback-loop.js";
import { rgbCss } from "./colour-scale.js";
import { set, state } from "./store.js";
import { initToolButton } from "./view-tools.js";

const MOST_FRAMES = 150;
const CLIP_WIDTH = 800; // pixels
let page = ""; // identifier of this page's session
/** @type {AbortController | null} */
let running = null; // cancels the clip that is being made

/**
 * Set the buttons up.
 * @param {string} id identifier of this page's session
 */
export function start(id) {
  page = id;
  initToolButton("still", "camera", "Save the picture as PNG", () => saveStill().catch(toast));
  initToolButton("clip", "film", "Save a clip as GIF: the looped part, or the whole sequence", () =>
    saveClip().catch(toast),
  );
}

/** Download the scene as PNG. */
async function saveStill() {
  const canvas = await captureCanvas(devicePixelRatio || 1);
  canvas.toBlob((blob) => blob && save(blob, "png"));
}

/**
 * Download the played frames as GIF. Each frame is shown in the scene and captured; the page then
 * shows the frame from before.
 */
async function saveClip() {
  const { series, frame: before, speed } = state();
  if (!series || running) return;
  running = new AbortController();
  const { signal } = running;
  set({ playing: false });
  const [from, to] = playedRange(series.time.length);
  const stride = Math.ceil((to - from + 1) / MOST_FRAMES);
  const frames = Array.from(
    { length: Math.floor((to - from) / stride) + 1 },
    (_, place) => from + place * stride,
  );
  const gif = GIFEncoder();
  try {
    for (const [place, frame] of frames.entries()) {
      showProgress(place, frames.length);
      set({ frame });
      await until(() => state().rendered?.view?.frame === frame, signal);
      const canvas = await captureCanvas(Math.min(1, CLIP_WIDTH / viewerBox().width), signal);
      const { data, width, height } = context(canvas).getImageData(
        0,
        0,
        canvas.width,
        canvas.height,
      );
      const palette = quantize(data, 256);
      const lasts = (series.time[Math.min(to, frame + stride)] - series.time[frame]) / speed;
      gif.writeFrame(applyPalette(data, palette), width, height, {
        palette,
        delay: Math.max(20, Math.round(1e3 * (lasts || 0.5))),
      });
    }
    gif.finish();
    save(new Blob([gif.bytes()], { type: "image/gif" }), "gif");
  } catch (error) {
    if (toError(error).name !== "AbortError") throw error;
  } finally {
    running = null;
    fill("clip-bar").hidden = true;
    set({ frame: before });
  }
}

/**
 * @param {number} done
 * @param {number} all
 */
function showProgress(done, all) {
  const bar = byId("clip-bar");
  bar.hidden = false;
  fill(
    bar,
    element("span", {}, `Clip: frame ${done + 1} of ${all}`),
    element(
      "div",
      { class: "progress" },
      element("i", { style: { width: `${(100 * done) / all}%` } }),
    ),
    element(
      "button",
      { class: "button small", type: "button", onclick: () => running?.abort() },
      "Cancel",
    ),
  );
}

/**
 * Wait until a condition holds.
 * @param {() => boolean} holds
 * @param {AbortSignal} signal
 */
async function until(holds, signal) {
  while (!holds()) {
    signal.throwIfAborted();
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

/**
 * @param {HTMLCanvasElement} canvas
 * @returns {CanvasRenderingContext2D}
 */
const context = (canvas) =>
  /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { willReadFrequently: true }));

const viewerBox = () => byId("viewer").getBoundingClientRect();

/**
 * Return a canvas with the scene, its legend and a caption on the page's background.
 * @param {number} ratio pixels of the canvas per pixel of the page
 * @param {AbortSignal} [signal]
 * @returns {Promise<HTMLCanvasElement>}
 */
async function captureCanvas(ratio, signal) {
  const { width, height } = viewerBox();
  const [wide, tall] = [width, height].map((edge) =>
    Math.max(16, Math.min(4096, Math.round(edge * ratio))),
  );
  const path = `/api/sessions/${page}/still.png?width=${wide}&height=${tall}`;
  const answer = await fetch(path, { signal });
  if (!answer.ok) throw new ApiError(await answer.json());
  const picture = await createImageBitmap(await answer.blob());
  const canvas = element("canvas", { width: wide, height: tall });
  const pen = context(canvas);
  const style = getComputedStyle(document.documentElement);
  /**
   * @param {string} name
   * @returns {string}
   */
  const ink = (name) => style.getPropertyValue(`--${name}`).trim();
  pen.fillStyle = ink("scene");
  pen.fillRect(0, 0, wide, tall);
  pen.drawImage(picture, 0, 0);
  pen.scale(ratio, ratio);
  pen.font = '12px "Inter", Arial, sans-serif';
  drawLegend(pen, ink);
  pen.fillStyle = ink("text-2");
  pen.textAlign = "left";
  pen.fillText(caption(), 16, height - 14);
  return canvas;
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {(name: string) => string} ink
 */
function drawLegend(pen, ink) {
  const what = legendContent();
  if (!what) return;
  const [left, top, wide, tall] = [16, 40, 16, 180];
  pen.fillStyle = ink("text");
  pen.textBaseline = "alphabetic";
  pen.fillText(what.title, left, 26);
  const step = tall / what.bands.length;
  [...what.bands].reverse().forEach((rgb, place) => {
    pen.fillStyle = rgbCss(rgb);
    pen.fillRect(left, top + place * step, wide, step + 0.5);
  });
  pen.fillStyle = ink("text-2");
  for (const part of [0, 0.25, 0.5, 0.75, 1]) {
    pen.fillText(
      `${+(what.high + (what.low - what.high) * part).toPrecision(3)}`.replace("-", "−"),
      left + wide + 8,
      top + part * tall + 4,
    );
  }
}

/** @returns {string} */
function caption() {
  const { series, frame, sequence, heading } = state();
  if (!series) return "";
  const errors = series.models
    .map((name) => `${name} ${formatMm(series[`distance_${name}`]?.[frame], false)}`)
    .join(", ");
  const time = `${series.time[frame].toFixed(2)} s`;
  return `${heading?.dataset ?? ""} · ${sequence} · ${time} · RMS error ${errors} mm`;
}

/**
 * Download a picture.
 * @param {Blob} blob
 * @param {"png" | "gif"} kind
 */
function save(blob, kind) {
  const { sequence, frame } = state();
  const link = element("a", {
    href: URL.createObjectURL(blob),
    download: kind === "png" ? `palpate-${sequence}-${frame + 1}.png` : `palpate-${sequence}.gif`,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}
