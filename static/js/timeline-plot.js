// Series of each frame against time in lanes with one cursor: errors with the noise floor, push depth, force, solver iterations.
import { formatMm } from "./format.js";

const LEFT = 46;
const RIGHT = 16;
const FOOT = 18;
const GAP = 13;

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

/** What is drawn: title, share of the height, curves with the colour and name of each, and how a number is told. */
function plotLanes(series) {
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
        values: series[`distance_${name}`],
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
      text: (value) => (Number.isFinite(value) ? `${value.toFixed(2)} N` : "–"),
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

/** All numbers of a frame in words, a line for each lane; models that found no equilibrium are named. */
export function frameSummary(series, frame) {
  const lines = plotLanes(series).map(({ curves, text }) =>
    curves.map(({ name, values }) => `${name} ${text(values[frame])}`).join("   "),
  );
  const failed = Object.entries(series.failed ?? {})
    .filter(([, frames]) => frames.includes(frame))
    .map(([name]) => name);
  return failed.length ? [...lines, `no equilibrium: ${failed.join(", ")}`] : lines;
}

export function drawPlot(canvas, series, frame, [first, last]) {
  const ratio = devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas.parentElement;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
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
    return;
  }
  const end = series.time[series.time.length - 1] || 1;
  const x = (time) => LEFT + (time / end) * (width - LEFT - RIGHT);
  canvas.timeAt = (pixel) =>
    Math.max(0, Math.min(end, ((pixel - LEFT) / (width - LEFT - RIGHT)) * end));
  canvas.timeToPixel = x;
  drawContacts(pen, { series, x, height, ink });
  const lanes = plotLanes(series);
  const titles = [];
  const head = series.worst.length ? 21 : 8; // room for the marks of the worst frames
  const whole = height - FOOT - head - GAP * (lanes.length - 1);
  const shares = lanes.reduce((sum, { share }) => sum + share, 0);
  let top = head;
  for (const lane of lanes) {
    const tall = (whole * lane.share) / shares;
    drawLane(pen, lane, { series, frame, width, top, tall, x, ink });
    titles.push([lane.title, top]);
    top += tall + GAP;
  }
  drawTimes(pen, { width, height, end, x, ink });
  drawFailed(pen, { series, x, height, ink });
  drawRange(pen, { series, first, last, x, height, ink });
  pen.textAlign = "left";
  pen.textBaseline = "top";
  pen.fillStyle = ink("text-2");
  for (const [title, at] of titles) pen.fillText(title, LEFT + 5, at + 2);
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
}

/** Where the tool touches: the frames of a spell and half way to those beside it. */
function drawContacts(pen, { series, x, height, ink }) {
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

function drawLane(pen, { factor, floor, curves }, { series, frame, width, top, tall, x, ink }) {
  const seen = [...curves.flatMap(({ values }) => values), floor].filter(Number.isFinite);
  const scale = axisScale(Math.max(0, ...seen) * factor, tall);
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
    pen.fillText(+value.toFixed(3), LEFT - 8, y(value / factor));
  }
  if (Number.isFinite(floor)) {
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
  const pixels = (values) =>
    series.time.map((time, i) => [x(time), Number.isFinite(values[i]) ? y(values[i]) : NaN]);
  for (const { values, ink: name } of curves) strokeLine(pen, pixels(values), ink(name), 1.8);
  for (const { values, ink: name } of curves) {
    if (!Number.isFinite(values[frame])) continue;
    pen.beginPath();
    pen.arc(x(series.time[frame]), y(values[frame]), 3.5, 0, 2 * Math.PI);
    pen.fillStyle = ink(name);
    pen.fill();
    pen.strokeStyle = ink("surface");
    pen.lineWidth = 1.5;
    pen.stroke();
  }
}

function drawTimes(pen, { height, end, x, ink }) {
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  pen.fillStyle = ink("text-3");
  const step = niceStep(end / 8);
  for (let time = 0; time <= end + 1e-9; time += step) {
    pen.fillText(`${+time.toFixed(2)}${time + step > end ? " s" : ""}`, x(time), height - 4);
  }
}

/** A mark on the foot of each frame in which a model found no equilibrium. */
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

/** What is outside the loop is dimmed; its ends are lines. */
function drawRange(pen, { series, first, last, x, height, ink }) {
  if (first === 0 && last === series.time.length - 1) return;
  const [from, to] = [x(series.time[first]), x(series.time[last])];
  pen.fillStyle = ink("surface");
  pen.globalAlpha = 0.62;
  pen.fillRect(LEFT - 3, 4, from - LEFT + 3, height - FOOT - 4);
  pen.fillRect(to, 4, x(series.time.at(-1)) + 3 - to, height - FOOT - 4);
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

function niceStep(wanted) {
  const decade = 10 ** Math.floor(Math.log10(wanted));
  return decade * [1, 2, 5, 10].find((part) => part * decade >= wanted * 0.999);
}

/** End and step of an axis that is `tall` pixels high. */
function axisScale(value, tall) {
  const step = niceStep((value || 0.1) / Math.max(1, Math.min(3, tall / 24)));
  return { step, end: step * Math.max(1, Math.ceil((value * 1.04) / step)) };
}
