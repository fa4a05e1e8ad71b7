// Contents of the lanes of a look's timeline: curves, ticks of clouds, and what is marked in them.
/** @import { Area } from "./look-timeline-plot.js" */
/** @import { Lane } from "./look-timeline-readings.js" */
/** @typedef {CanvasRenderingContext2D} Context */
/** @typedef {{ top: number, bottom: number }} Place */
/**
 * The axis of a lane: its range in the unit that is shown, and the pixel of a value.
 * @typedef {{ low: number, high: number, margin: number, places: number,
 *   y: (value: number) => number }} Axis
 */

// How far above the surface the lane of depths goes: in mm, and in depths of the deepest push.
const CLEAR = 4;
const CLEARANCE = 1.5;

/**
 * Draw the curves of a lane with an axis of three values; a lane of depth has a line at zero.
 * @param {Context} pen
 * @param {Area} area
 * @param {Lane} lane
 * @param {Place} place
 * @returns {Axis}
 */
export function drawCurve(pen, { scale, ink, plot }, lane, { top, bottom }) {
  const [from, to] = plot.view;
  let low = Infinity;
  let high = -Infinity;
  for (const { values } of lane.curves)
    for (const [at, value] of values.entries())
      if (value !== null && lane.t[at] >= from && lane.t[at] <= to) {
        low = Math.min(low, value * lane.factor);
        high = Math.max(high, value * lane.factor);
      }
  if (!Number.isFinite(low)) [low, high] = [0, 1];
  // Depth grows downwards, as the tool goes; far from the surface its curve leaves the lane.
  const down = lane.curves.some(({ name }) => name === "depth");
  if (down || lane.name === "force") [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  if (down && high > 0) low = Math.max(low, -Math.max(CLEAR, CLEARANCE * high));
  const margin = (high - low || 1) * 0.08;
  [low, high] = [low - margin, high + margin];
  /** @param {number} value in the unit of the axis */
  const y = (value) => {
    const share = (value - low) / (high - low);
    return down ? top + share * (bottom - top) : bottom - share * (bottom - top);
  };
  const wide = scale.right - scale.left;
  pen.fillStyle = ink("line");
  if (low < 0 && high > 0) pen.fillRect(scale.left, y(0), wide, 1);
  pen.fillRect(scale.left, bottom - 1, wide, 1);
  for (const { ink: colour, values } of lane.curves) {
    pen.strokeStyle = ink(colour);
    pen.lineWidth = 1.3;
    pen.lineJoin = "round";
    pen.beginPath();
    let drawing = false;
    for (const [at, value] of values.entries()) {
      if (value === null) {
        drawing = false;
        continue;
      }
      const [x, height] = [scale.x(lane.t[at]), y(value * lane.factor)];
      if (drawing) pen.lineTo(x, height);
      else pen.moveTo(x, height);
      drawing = true;
    }
    pen.stroke();
  }
  return { low, high, margin, y, places: lane.factor === 1 ? 1 : 0 };
}

/**
 * Write the least and the greatest value beside a lane, and zero where it is between.
 * @param {Context} pen
 * @param {Area} area
 * @param {Axis} axis
 */
export function drawAxis(pen, { scale, ink }, { low, high, margin, y, places }) {
  pen.fillStyle = ink("text-3");
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  const values = [low + margin, high - margin];
  if (low < 0 && high > 0 && values.every((value) => Math.abs(y(value) - y(0)) > 11))
    values.push(0);
  for (const value of values)
    pen.fillText(
      value
        .toFixed(places)
        .replace(/^-(?=0(\.0)?$)/, "")
        .replace("-", "−"),
      scale.left - 6,
      y(value),
    );
}

/**
 * Draw a tick for each cloud; those that the scene can show are tall.
 * @param {Context} pen
 * @param {Area} area
 * @param {Place} place
 */
export function drawTicks(pen, { scale, ink, plot }, { top, bottom }) {
  const { t, shown } = plot.recording.clouds ?? { t: [], shown: [] };
  const stored = new Set(shown);
  pen.fillStyle = ink("measured");
  for (const [at, time] of t.entries()) {
    const x = scale.x(time);
    if (x < scale.left || x > scale.right) continue;
    const tall = stored.has(at);
    pen.fillRect(x - 0.5, tall ? top + 1 : top + 6, 1, tall ? bottom - top - 2 : bottom - top - 7);
  }
}

/**
 * Mark the rest window and touches in the tool's lane, gaps and faults of its stream in each.
 * @param {Context} pen
 * @param {Area} area
 * @param {Lane} lane
 * @param {Place} place
 */
export function drawMarks(pen, area, lane, place) {
  if (lane.name === "tool") drawRestAndTouches(pen, area, place);
  if (!lane.stream) return;
  const { scale, ink } = area;
  const { top, bottom } = place;
  pen.fillStyle = ink("danger");
  pen.strokeStyle = ink("danger");
  pen.lineWidth = 1;
  for (const [start, end] of lane.stream.gaps) {
    const [a, b] = [scale.x(start), Math.max(scale.x(start) + 2, scale.x(end))];
    if (b < scale.left || a > scale.right) continue;
    pen.globalAlpha = 0.18;
    pen.fillRect(a, top, b - a, bottom - top);
    pen.globalAlpha = 1;
    pen.fillRect(a, bottom - 2, b - a, 2);
  }
  for (const { t } of lane.stream.faults) {
    const x = scale.x(t);
    if (x < scale.left - 4 || x > scale.right + 4) continue;
    pen.beginPath();
    pen.moveTo(x - 4, bottom - 1);
    pen.lineTo(x + 4, bottom - 1);
    pen.lineTo(x, bottom - 9);
    pen.fill();
  }
}

/**
 * @param {Context} pen
 * @param {Area} area
 * @param {Place} place
 */
function drawRestAndTouches(pen, { scale, ink, plot }, { top, bottom }) {
  const { rest, touches } = plot.recording;
  let free = -Infinity; // where the last label ends
  /**
   * @param {number} start
   * @param {number} end
   * @param {string} colour
   * @param {string} label
   */
  const band = (start, end, colour, label) => {
    const [a, b] = [scale.x(start), Math.max(scale.x(start) + 2, scale.x(end))];
    if (b < scale.left || a > scale.right) return;
    pen.fillStyle = ink(colour);
    pen.globalAlpha = 0.16;
    pen.fillRect(a, top, b - a, bottom - top);
    pen.globalAlpha = 1;
    pen.fillRect(a, bottom - 3, b - a, 3);
    const wide = pen.measureText(label).width;
    const x = Math.max(scale.left + 4, Math.min((a + b) / 2 - wide / 2, scale.right - wide - 4));
    if (x < free) return;
    free = x + wide + 6;
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    pen.strokeStyle = ink("surface");
    pen.lineWidth = 3;
    pen.strokeText(label, x, bottom - 5);
    pen.fillText(label, x, bottom - 5);
  };
  /** @type {[number, number, string, string][]} */
  const bands = touches.map(({ start, end, landmark }) => [start, end, "landmarks", landmark]);
  if (rest) bands.push([...rest, "accent", "rest"]);
  for (const one of bands.sort((a, b) => a[0] - b[0])) band(...one);
}
