// The plot of the timeline: curves over time in lanes with one cursor. Lanes: errors with the
// noise floor, push depth, force, solver iterations.
import { formatMm } from "./format.js";

/** @import { FrameValues, Model, Series } from "./types.js" */

/**
 * A lane: its share of the height, its curves with their colours, and how a value is written.
 * @typedef {object} Lane
 * @property {string} title
 * @property {number} share
 * @property {number} factor from SI units to the unit of the axis
 * @property {number | null} [floor] noise floor
 * @property {(value: number | null) => string} text
 * @property {{ name: string, ink: string, values: FrameValues }[]} curves
 */
/**
 * What the parts of the plot are drawn with; lengths in pixels.
 * @typedef {object} Layout
 * @property {Series} series
 * @property {number} frame
 * @property {number} width
 * @property {number} height
 * @property {(time: number) => number} x
 * @property {(name: string) => string} ink colour by the name of a CSS variable
 */
/**
 * Conversions between times [s] and pixels of the plot as it was last drawn.
 * @typedef {{ timeAt: (pixel: number) => number, timeToPixel: (time: number) => number }} TimeScale
 */
/** @typedef {CanvasRenderingContext2D} Context */

// Margins in pixels.
const LEFT = 46;
const RIGHT = 16;
const FOOT = 18;
const GAP = 13;

/**
 * Return the frame nearest to a time; `times` ascend.
 * @param {number[]} times
 * @param {number} time
 * @returns {number}
 */
export function frameAt(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= times[high] - time ? low : high;
}

/**
 * @param {Series} series
 * @returns {Lane[]}
 */
function plotLanes(series) {
  /** @type {Lane[]} */
  const lanes = [
    {
      title: "RMS error, mm",
      share: 2.2,
      factor: 1e3,
      floor: series.noise_floor,
      text: (value) => formatMm(value),
      curves: series.models.map((name) => ({
        name,
        ink: name,
        values: series[`distance_${name}`] ?? [],
      })),
    },
  ];
  if (series.depth)
    lanes.push({
      title: "Push depth, mm",
      share: 1,
      factor: 1e3,
      text: (value) => formatMm(value),
      curves: [{ name: "depth", ink: "tool", values: series.depth }],
    });
  const forces = Object.entries(series.forces ?? {}).map(([name, values]) => ({
    name: `${name} force`,
    ink: name,
    values,
  }));
  if (series.force) forces.push({ name: "force", ink: "measured", values: series.force });
  if (forces.length)
    lanes.push({
      title: "Contact force, N",
      share: 1,
      factor: 1,
      text: (value) => (isNumber(value) ? `${value.toFixed(2)} N` : "–"),
      curves: forces,
    });
  if (series.iterations) {
    const curves = Object.entries(series.iterations).map(([name, values]) => ({
      name: `${name} iterations`,
      ink: name,
      values,
    }));
    lanes.push({
      title: "Solver iterations",
      share: 1,
      factor: 1,
      text: (value) => String(value),
      curves,
    });
  }
  return lanes;
}

/**
 * Return all values of a frame as text, a line for each lane, and the models without an
 * equilibrium.
 * @param {Series} series
 * @param {number} frame
 * @returns {string[]}
 */
export function frameSummary(series, frame) {
  const lines = plotLanes(series).map(({ curves, text }) =>
    curves.map(({ name, values }) => `${name} ${text(values[frame])}`).join("   "),
  );
  const failed = Object.entries(series.failed ?? {})
    .filter(([, frames]) => frames?.includes(frame))
    .map(([name, frames]) => {
      const reason = series.reasons?.[/** @type {Model} */ (name)]?.[frames.indexOf(frame)];
      return `${name} model: ${reason ?? "no equilibrium"}`;
    });
  return [...lines, ...failed];
}

/**
 * Draw the plot and return its time scale; null without a sequence.
 * @param {HTMLCanvasElement} canvas
 * @param {Series | null} series
 * @param {number} frame
 * @param {[number, number]} range first and last frame that are played
 * @returns {TimeScale | null}
 */
export function drawPlot(canvas, series, frame, [first, last]) {
  const ratio = devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas.parentElement ?? canvas;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const pen = /** @type {Context} */ (canvas.getContext("2d"));
  pen.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
  /**
   * @param {string} name
   * @returns {string}
   */
  const ink = (name) => style.getPropertyValue(`--${name}`).trim();
  pen.font = '11px "Inter", Arial, sans-serif';
  if (!series) {
    pen.fillStyle = ink("text-3");
    pen.textAlign = "center";
    pen.fillText(
      "The error of each frame appears here once a diagnosis is open.",
      width / 2,
      height / 2,
    );
    return null;
  }
  const end = series.time[series.time.length - 1] || 1;
  /**
   * @param {number} time
   * @returns {number}
   */
  const x = (time) => LEFT + (time / end) * (width - LEFT - RIGHT);
  /** @param {number} pixel */
  const timeAt = (pixel) =>
    Math.max(0, Math.min(end, ((pixel - LEFT) / (width - LEFT - RIGHT)) * end));
  const layout = { series, frame, width, height, x, ink };
  drawContacts(pen, layout);
  const lanes = plotLanes(series);
  /** @type {[string, number][]} */
  const titles = [];
  const head = series.worst.length ? 21 : 8; // room for the marks of the worst frames
  const whole = height - FOOT - head - GAP * (lanes.length - 1);
  const shares = lanes.reduce((sum, { share }) => sum + share, 0);
  let top = head;
  for (const lane of lanes) {
    const tall = (whole * lane.share) / shares;
    drawLane(pen, lane, layout, top, tall);
    titles.push([lane.title, top]);
    top += tall + GAP;
  }
  drawTimes(pen, layout, end);
  drawFailed(pen, layout);
  drawRange(pen, layout, first, last);
  pen.textAlign = "left";
  pen.textBaseline = "top";
  pen.fillStyle = ink("text-2");
  // A margin in the colour of the page keeps a title legible where a line runs through it.
  pen.strokeStyle = ink("surface");
  pen.lineWidth = 4;
  for (const [title, at] of titles) {
    pen.strokeText(title, LEFT + 5, at + 2);
    pen.fillText(title, LEFT + 5, at + 2);
  }
  const at = x(series.time[frame]);
  strokeLine(
    pen,
    [
      [at, 4],
      [at, height - FOOT],
    ],
    ink("text"),
    1.2,
  );
  return { timeAt, timeToPixel: x };
}

/**
 * Shade the times of contact: the frames of each and half way to their neighbours.
 * @param {Context} pen
 * @param {Layout} layout
 */
function drawContacts(pen, { series, x, height, ink }) {
  /**
   * @param {number} one
   * @param {number} other
   * @returns {number}
   */
  const between = (one, other) => (series.time[one] + (series.time[other] ?? series.time[one])) / 2;
  pen.fillStyle = ink("sunken");
  for (const [first, last] of series.touching) {
    const [from, to] = [
      x(between(first, Math.max(0, first - 1))),
      x(between(last, Math.min(series.time.length - 1, last + 1))),
    ];
    pen.fillRect(from, 4, Math.max(1, to - from), height - FOOT - 4);
  }
}

/**
 * @param {Context} pen
 * @param {Lane} lane
 * @param {Layout} layout
 * @param {number} top
 * @param {number} tall height in pixels
 */
function drawLane(pen, { factor, floor, curves }, { series, frame, width, x, ink }, top, tall) {
  const seen = [...curves.flatMap(({ values }) => values), floor].filter(isNumber);
  const scale = axisScale(Math.max(0, ...seen) * factor, tall);
  /**
   * @param {number} value
   * @returns {number}
   */
  const y = (value) => top + tall - ((value * factor) / scale.end) * tall;
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  for (let value = 0; value <= scale.end * 1.0001; value += scale.step) {
    strokeLine(
      pen,
      [
        [LEFT, y(value / factor)],
        [width - RIGHT, y(value / factor)],
      ],
      ink("line"),
      1,
    );
    pen.fillStyle = ink("text-3");
    pen.fillText(String(+value.toFixed(3)), LEFT - 8, y(value / factor));
  }
  if (isNumber(floor)) {
    pen.fillStyle = ink("floor");
    pen.globalAlpha = 0.32;
    pen.fillRect(LEFT, y(floor), width - LEFT - RIGHT, y(0) - y(floor));
    pen.globalAlpha = 1;
    strokeLine(
      pen,
      [
        [LEFT, y(floor)],
        [width - RIGHT, y(floor)],
      ],
      ink("floor"),
      1.5,
    );
  }
  /** @param {number | null} value */
  const toY = (value) => (isNumber(value) ? y(value) : NaN);
  /**
   * @param {FrameValues} values
   * @returns {number[][]}
   */
  const pixels = (values) => series.time.map((time, i) => [x(time), toY(values[i])]);
  for (const { values, ink: name } of curves) strokeLine(pen, pixels(values), ink(name), 1.8);
  for (const { values, ink: name } of curves) {
    const value = values[frame];
    if (!isNumber(value)) continue;
    pen.beginPath();
    pen.arc(x(series.time[frame]), y(value), 3.5, 0, 2 * Math.PI);
    pen.fillStyle = ink(name);
    pen.fill();
    pen.strokeStyle = ink("surface");
    pen.lineWidth = 1.5;
    pen.stroke();
  }
}

/**
 * @param {Context} pen
 * @param {Layout} layout
 * @param {number} end last time [s]
 */
function drawTimes(pen, { height, x, ink }, end) {
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  pen.fillStyle = ink("text-3");
  const step = niceStep(end / 8);
  for (let time = 0; time <= end + 1e-9; time += step) {
    pen.fillText(`${+time.toFixed(2)}${time + step > end ? " s" : ""}`, x(time), height - 4);
  }
}

/**
 * Mark each frame in which a model found no equilibrium.
 * @param {Context} pen
 * @param {Layout} layout
 */
function drawFailed(pen, { series, x, height, ink }) {
  pen.fillStyle = ink("danger");
  for (const at of new Set(Object.values(series.failed ?? {}).flat())) {
    const px = x(series.time[at]);
    pen.beginPath();
    pen.moveTo(px - 4, height - FOOT + 5);
    pen.lineTo(px + 4, height - FOOT + 5);
    pen.lineTo(px, height - FOOT - 3);
    pen.fill();
  }
}

/**
 * Dim what is outside the loop and draw lines at its ends.
 * @param {Context} pen
 * @param {Layout} layout
 * @param {number} first
 * @param {number} last
 */
function drawRange(pen, { series, x, height, ink }, first, last) {
  if (first === 0 && last === series.time.length - 1) return;
  const [from, to] = [x(series.time[first]), x(series.time[last])];
  pen.fillStyle = ink("surface");
  pen.globalAlpha = 0.62;
  pen.fillRect(LEFT - 3, 4, from - LEFT + 3, height - FOOT - 4);
  pen.fillRect(to, 4, x(series.time[series.time.length - 1]) + 3 - to, height - FOOT - 4);
  pen.globalAlpha = 1;
  for (const at of [from, to])
    strokeLine(
      pen,
      [
        [at, 4],
        [at, height - FOOT],
      ],
      ink("accent"),
      2,
    );
}

/**
 * Draw a polyline, interrupted where y is NaN.
 * @param {Context} pen
 * @param {number[][]} points
 * @param {string} colour
 * @param {number} width
 */
function strokeLine(pen, points, colour, width) {
  pen.beginPath();
  let down = false;
  for (const [px, py] of points) {
    if (Number.isNaN(py)) {
      down = false;
      continue;
    }
    if (down) pen.lineTo(px, py);
    else pen.moveTo(px, py);
    down = true;
  }
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.stroke();
}

/**
 * Return the smallest of 1, 2, 5 times a power of ten that is not below a step.
 * @param {number} least
 * @returns {number}
 */
function niceStep(least) {
  const decade = 10 ** Math.floor(Math.log10(least));
  return decade * ([1, 2, 5, 10].find((part) => part * decade >= least * 0.999) ?? 10);
}

/**
 * Return end and step of an axis that is `tall` pixels high.
 * @param {number} value
 * @param {number} tall
 * @returns {{ step: number, end: number }}
 */
function axisScale(value, tall) {
  const step = niceStep((value || 0.1) / Math.max(1, Math.min(3, tall / 24)));
  return { step, end: step * Math.max(1, Math.ceil((value * 1.04) / step)) };
}

/**
 * @param {unknown} value
 * @returns {value is number}
 */
function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}
