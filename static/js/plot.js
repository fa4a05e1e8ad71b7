// Error of each frame against time: raw, extended and the noise floor, with the shared cursor.
const LEFT = 46;
const RIGHT = 16;

export function frameAt(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= time) low = middle; else high = middle; }
  return time - times[low] <= times[high] - time ? low : high;
}

export function drawPlot(canvas, series, frame) {
  const ratio = devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas.parentElement;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
  const ink = (name) => style.getPropertyValue(`--${name}`).trim();
  pen.font = '11px "Inter", Arial, sans-serif';
  if (!series) {
    pen.fillStyle = ink("text-3");
    pen.textAlign = "center";
    pen.fillText("The error of each frame appears here once a diagnosis is open.", width / 2, height / 2);
    return;
  }
  const end = series.time[series.time.length - 1] || 1;
  const seen = [...series.distance_raw, ...series.distance_extended, series.noise_floor].filter(Number.isFinite);
  const top = niceTop(Math.max(...seen) * 1e3);
  const x = (time) => LEFT + time / end * (width - LEFT - RIGHT);
  const y = (metres) => height - 18 - metres * 1e3 / top.end * (height - 26);
  canvas.timeAt = (pixel) => Math.max(0, Math.min(end, (pixel - LEFT) / (width - LEFT - RIGHT) * end));
  drawAxes(pen, { width, height, end, top, x, y, ink });
  if (Number.isFinite(series.noise_floor)) {
    pen.fillStyle = ink("floor"); pen.globalAlpha = 0.32;
    pen.fillRect(LEFT, y(series.noise_floor), width - LEFT - RIGHT, y(0) - y(series.noise_floor));
    pen.globalAlpha = 1;
    line(pen, [[LEFT, y(series.noise_floor)], [width - RIGHT, y(series.noise_floor)]], ink("floor"), 1.5);
  }
  for (const [key, name] of [["distance_raw", "raw"], ["distance_extended", "extended"]]) {
    line(pen, series.time.map((time, i) => [x(time), Number.isFinite(series[key][i]) ? y(series[key][i]) : NaN]), ink(name), 1.8);
  }
  drawCursor(pen, { series, frame, height, x, y, ink });
}

function drawAxes(pen, { width, height, end, top, x, y, ink }) {
  pen.textBaseline = "middle"; pen.textAlign = "right";
  for (let value = 0; value <= top.end + 1e-9; value += top.step) {
    line(pen, [[LEFT, y(value / 1e3)], [width - RIGHT, y(value / 1e3)]], ink("line"), 1);
    pen.fillStyle = ink("text-3");
    pen.fillText(+value.toFixed(3), LEFT - 8, y(value / 1e3));
  }
  pen.save(); pen.translate(11, (height - 18) / 2); pen.rotate(-Math.PI / 2); pen.textAlign = "center";
  pen.fillText("RMS, mm", 0, 0); pen.restore();
  pen.textAlign = "center"; pen.textBaseline = "alphabetic";
  const step = niceStep(end / 8);
  for (let time = 0; time <= end + 1e-9; time += step) {
    pen.fillText(`${+time.toFixed(2)}${time + step > end ? " s" : ""}`, x(time), height - 4);
  }
}

function drawCursor(pen, { series, frame, height, x, y, ink }) {
  const at = x(series.time[frame]);
  line(pen, [[at, 4], [at, height - 18]], ink("text"), 1.2);
  for (const [key, name] of [["distance_raw", "raw"], ["distance_extended", "extended"]]) {
    if (!Number.isFinite(series[key][frame])) continue;
    pen.beginPath(); pen.arc(at, y(series[key][frame]), 4, 0, 2 * Math.PI);
    pen.fillStyle = ink(name); pen.fill(); pen.strokeStyle = ink("surface"); pen.lineWidth = 1.5; pen.stroke();
  }
}

function line(pen, points, colour, width) {
  pen.beginPath();
  let down = false;
  for (const [px, py] of points) {
    if (Number.isNaN(py)) { down = false; continue; }
    if (down) pen.lineTo(px, py); else pen.moveTo(px, py);
    down = true;
  }
  pen.strokeStyle = colour; pen.lineWidth = width; pen.lineJoin = "round"; pen.stroke();
}

function niceStep(wanted) {
  const decade = 10 ** Math.floor(Math.log10(wanted));
  return decade * [1, 2, 5, 10].find((part) => part * decade >= wanted * 0.999);
}

function niceTop(value) {
  const step = niceStep((value || 0.1) / 3);
  return { step, end: step * Math.ceil(value * 1.04 / step) };
}
