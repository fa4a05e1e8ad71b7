// Drawing of a look's timeline: lanes for depth or height, forces, clouds and sequences over one
// time scale, with touches, rest, gaps and faults marked in them.
import { drawAxis, drawCurve, drawMarks, drawTicks } from "./look-timeline-lanes.js";
import { lanesOf } from "./look-timeline-readings.js";

/** @import { Lane } from "./look-timeline-readings.js" */
/** @import { CutSequence, LookRecording, LookScale } from "./types.js" */
/** @typedef {CanvasRenderingContext2D} Context */

/**
 * What is drawn.
 * @typedef {object} LookPlot
 * @property {LookRecording} recording
 * @property {[number, number]} view first and last time in sight [s]
 * @property {number} cursor
 * @property {CutSequence[]} sequences
 * @property {number | null} selected
 * @property {[number, number] | null} drawn a sequence that is being drawn
 */

// In pixels.
const LEFT = 46;
const RIGHT = 14;
const FOOT = 24;
const GAP = 9;
const HEAD = 6;
/**
 * Draw the timeline and return its scale.
 * @param {HTMLCanvasElement} canvas
 * @param {LookPlot} plot
 * @returns {LookScale}
 */
export function drawLookTimeline(canvas, plot) {
  const ratio = devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas.parentElement ?? canvas;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const pen = /** @type {Context} */ (canvas.getContext("2d"));
  pen.scale(ratio, ratio);
  pen.font = '11px "Inter", Arial, sans-serif';
  const style = getComputedStyle(document.documentElement);
  /** @param {string} name */
  const ink = (name) => style.getPropertyValue(`--${name}`).trim();
  const [from, to] = plot.view;
  const right = width - RIGHT;
  /** @type {LookScale} */
  const scale = {
    x: (time) => LEFT + ((time - from) / (to - from)) * (right - LEFT),
    timeAt: (pixel) => from + ((pixel - LEFT) / (right - LEFT)) * (to - from),
    left: LEFT,
    right,
    sequences: null,
    lanes: [],
  };
  const lanes = lanesOf(plot.recording);
  const fixed = lanes.reduce((sum, lane) => sum + lane.fixed, 0);
  const shares = lanes.reduce((sum, { share }) => sum + share, 0) || 1;
  const free = height - HEAD - FOOT - fixed - GAP * (lanes.length - 1);
  let top = HEAD;
  for (const lane of lanes) {
    const bottom = top + (lane.fixed || (Math.max(0, free) * lane.share) / shares);
    scale.lanes.push({ name: lane.name, top, bottom });
    top = bottom + GAP;
  }
  const area = { scale, ink, plot };
  for (const [at, lane] of lanes.entries()) {
    const place = scale.lanes[at];
    pen.fillStyle = ink("sunken");
    if (lane.fixed) pen.fillRect(LEFT, place.top, right - LEFT, lane.fixed);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, place.top, right - LEFT, place.bottom - place.top);
    pen.clip();
    if (lane.name === "sequences") drawSequences(pen, area, place);
    else if (lane.name === "clouds") drawTicks(pen, area, place);
    const axis = lane.curves.length ? drawCurve(pen, area, lane, place) : null;
    drawMarks(pen, area, lane, place);
    pen.restore();
    if (axis) drawAxis(pen, area, axis);
    drawTitle(pen, area, lane, place);
    if (lane.name === "sequences") scale.sequences = [place.top, place.bottom];
  }
  drawTimes(pen, area, height);
  drawCursor(pen, area, height);
  return scale;
}

/** @typedef {{ scale: LookScale, ink: (name: string) => string, plot: LookPlot }} Area */

/**
 * @param {Context} pen
 * @param {Area} area
 * @param {{ top: number, bottom: number }} place
 */
function drawSequences(pen, { scale, ink, plot }, { top, bottom }) {
  const tall = bottom - top;
  for (const { key, name, kind, start, end, split } of plot.sequences) {
    const [a, b] = [scale.x(start), scale.x(end)];
    if (b < scale.left || a > scale.right) continue;
    const chosen = key === plot.selected;
    const colour = ink(`kind-${kind || "none"}`);
    pen.globalAlpha = chosen ? 0.42 : 0.22;
    pen.fillStyle = colour;
    pen.fillRect(a, top, Math.max(2, b - a), tall);
    pen.globalAlpha = 1;
    pen.strokeStyle = colour;
    pen.lineWidth = chosen ? 2.5 : 1.25;
    pen.strokeRect(a + 1, top + 1.5, Math.max(1, b - a - 2), tall - 3);
    if (chosen)
      for (const end_ of [a, b]) {
        pen.fillStyle = colour;
        pen.fillRect(end_ - 3, top + tall / 2 - 7, 6, 14);
      }
    writeWithin(
      pen,
      split ? `${name} · ${split}` : name,
      name,
      [a, b],
      top + tall / 2,
      ink("text"),
    );
  }
  if (plot.drawn) {
    const [a, b] = plot.drawn.map(scale.x);
    pen.fillStyle = ink("accent");
    pen.globalAlpha = 0.3;
    pen.fillRect(Math.min(a, b), top, Math.abs(b - a), tall);
    pen.globalAlpha = 1;
  }
}

/**
 * Write a text in the middle of a bar, or the shorter one, or its beginning, as it fits.
 * @param {Context} pen
 * @param {string} text
 * @param {string} short
 * @param {[number, number]} ends
 * @param {number} y
 * @param {string} colour
 */
function writeWithin(pen, text, short, [a, b], y, colour) {
  const room = b - a - 12;
  /** @param {string} one */
  const fits = (one) => pen.measureText(one).width <= room;
  let shown = [text, short].find(fits) ?? "";
  for (let length = short.length - 1; !shown && length > 2; length--)
    if (fits(`${short.slice(0, length)}…`)) shown = `${short.slice(0, length)}…`;
  if (!shown) return;
  pen.fillStyle = colour;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(shown, (a + b) / 2, y + 0.5);
}

/**
 * @param {Context} pen
 * @param {Area} area
 * @param {Lane} lane
 * @param {{ top: number, bottom: number }} place
 */
function drawTitle(pen, { scale, ink }, lane, { top, bottom }) {
  pen.textBaseline = "top";
  pen.textAlign = "left";
  if (lane.name === "clouds" || lane.name === "sequences") {
    pen.fillStyle = ink("text-3");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.fillText(lane.name === "clouds" ? "clouds" : "cut", LEFT - 6, (top + bottom) / 2);
    return;
  }
  pen.strokeStyle = ink("surface");
  pen.lineWidth = 4;
  pen.strokeText(lane.title, scale.left + 9, top + 2);
  pen.fillStyle = ink("text-2");
  pen.fillText(lane.title, scale.left + 9, top + 2);
}

/**
 * Draw the times below, counted from the start of the recording, and the part in sight.
 * @param {Context} pen
 * @param {Area} area
 * @param {number} height
 */
function drawTimes(pen, { scale, ink, plot }, height) {
  const { start, end } = plot.recording;
  const [from, to] = plot.view;
  const step = niceStep((to - from) / Math.max(2, (scale.right - scale.left) / 90));
  const places = Math.max(0, -Math.floor(Math.log10(step)));
  pen.fillStyle = ink("text-3");
  pen.textAlign = "center";
  pen.textBaseline = "top";
  for (let at = Math.ceil((from - start) / step); at * step <= to - start + 1e-9; at++) {
    const x = scale.x(start + at * step);
    pen.fillText(`${(at * step).toFixed(places)}${at === 0 ? " s" : ""}`, x, height - FOOT + 4);
    pen.fillRect(x, height - FOOT, 1, 3);
  }
  const whole = Math.max(1e-9, end - start);
  if (to - from < whole * 0.999) {
    const wide = scale.right - scale.left;
    pen.fillStyle = ink("line");
    pen.fillRect(scale.left, height - 5, wide, 3);
    pen.fillStyle = ink("text-3");
    const length = Math.max(8, ((to - from) / whole) * wide);
    pen.fillRect(scale.left + ((from - start) / whole) * wide, height - 5, length, 3);
  }
}

/**
 * @param {Context} pen
 * @param {Area} area
 * @param {number} height
 */
function drawCursor(pen, { scale, ink, plot }, height) {
  const x = scale.x(plot.cursor);
  if (x < scale.left - 1 || x > scale.right + 1) return;
  pen.fillStyle = ink("text");
  pen.fillRect(x - 0.6, 2, 1.2, height - FOOT - 2);
  pen.beginPath();
  pen.moveTo(x - 5, 0);
  pen.lineTo(x + 5, 0);
  pen.lineTo(x, 7);
  pen.fill();
}

/**
 * Return the least of 1, 2 and 5 times a power of ten that is not less.
 * @param {number} least
 * @returns {number}
 */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(Math.max(least, 1e-6)));
  return [1, 2, 5, 10].map((one) => one * power).find((one) => one >= least * 0.999) ?? least;
}
