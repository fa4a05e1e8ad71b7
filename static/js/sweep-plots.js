// The points of a sweep: against one parameter, as a map over two, as parallel lines over more. Failed points are crosses.
import { element } from "./dom.js";

const WIDTH = 380;
const HEIGHT = 230;
const MARGIN = { left: 56, right: 14, top: 10, bottom: 34 };
const LOW = [13, 148, 136];
const HIGH = [224, 152, 32];

function svg(name, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children.flat(2).filter((child) => child !== null));
  return node;
}

/** The picture of these points; `axes` have name, label, low, high, log, show(value). */
export function sweepPlot(axes, points, stated, best) {
  if (axes.length === 1) return linePlot(axes[0], points, stated, best);
  const known = points.map(({ error }) => error).filter((error) => error !== null);
  const range = known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
  const picture =
    axes.length === 2
      ? heatMap(axes, points, range, best)
      : parallelPlot(axes, points, range, best);
  return element(
    "div",
    {},
    picture,
    element(
      "div",
      { class: "sweep-scale" },
      element("span", {}, formatError(range[0])),
      element("i", { style: { background: `linear-gradient(90deg, ${rgb(LOW)}, ${rgb(HIGH)})` } }),
      element("span", {}, formatError(range[1])),
    ),
  );
}

/** A change of the error: two digits, and nothing finer than a thousandth of a millimetre. */
export const formatErrorChange = (metres) =>
  Math.abs(metres) < 1e-6 ? "under 0.001 mm" : `${+(metres * 1e3).toPrecision(2)} mm`;

export const formatError = (metres) =>
  metres === null || metres === undefined ? "–" : `${(metres * 1e3).toPrecision(4)} mm`;

const rgb = (parts) => `rgb(${parts.map(Math.round).join(" ")})`;

function colour(error, [low, high]) {
  const share = high > low ? (error - low) / (high - low) : 0;
  return rgb(LOW.map((part, index) => part + share * (HIGH[index] - part)));
}

const shareOf = ({ low, high, log }, value) =>
  log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);

const pointTitle = (axes, point) =>
  svg(
    "title",
    {},
    `${axes.map((axis) => `${axis.label} ${axis.show(point.values[axis.name])}`).join(", ")}: ${point.error === null ? `failed: ${point.failure}` : formatError(point.error)}`,
  );

const cross = (x, y, ...inside) =>
  svg(
    "path",
    { class: "failed", "data-failed": "", d: `M${x - 4} ${y - 4}l8 8M${x + 4} ${y - 4}l-8 8` },
    ...inside,
  );

function axes2d(axis, upright, ticks) {
  const { left, right, top, bottom } = MARGIN;
  const across = (share) => left + share * (WIDTH - left - right);
  return [
    svg("path", {
      class: "axis",
      fill: "none",
      d: `M${left} ${top}V${HEIGHT - bottom}H${WIDTH - right}`,
    }),
    ...[0, 0.5, 1].map((share) =>
      svg(
        "text",
        {
          x: across(share),
          y: HEIGHT - bottom + 14,
          "text-anchor": ["start", "middle", "end"][share * 2],
        },
        axis.show(valueAt(axis, share)),
      ),
    ),
    svg("text", { x: across(0.5), y: HEIGHT - 4, "text-anchor": "middle" }, axis.label),
    ...ticks.map(({ share, text }) =>
      svg("text", { x: left - 6, y: toY(share) + 4, "text-anchor": "end" }, text),
    ),
    svg(
      "text",
      {
        x: 11,
        y: HEIGHT / 2 - 10,
        transform: `rotate(-90 11 ${HEIGHT / 2 - 10})`,
        "text-anchor": "middle",
      },
      upright,
    ),
  ];
}

const valueAt = ({ low, high: top, log }, share) =>
  log ? low * (top / low) ** share : low + share * (top - low);
const toY = (share) => HEIGHT - MARGIN.bottom - share * (HEIGHT - MARGIN.top - MARGIN.bottom);
const toX = (share) => MARGIN.left + share * (WIDTH - MARGIN.left - MARGIN.right);

function linePlot(axis, points, stated, best) {
  const known = points.filter(({ error }) => error !== null);
  const errors = [
    ...known.map(({ error }) => error),
    ...(stated === null || stated === undefined ? [] : [stated]),
  ];
  const [least, most] = errors.length ? [Math.min(...errors), Math.max(...errors)] : [0, 1e-3];
  const room = Math.max((most - least) * 0.12, most * 0.02);
  const [from, to] = [Math.max(0, least - room), most + room];
  const y = (error) => toY((error - from) / (to - from));
  const ticks = [0, 0.5, 1].map((share) => ({
    share,
    text: ((from + share * (to - from)) * 1e3).toPrecision(3),
  }));
  const sorted = [...known].sort((a, b) => a.values[axis.name] - b.values[axis.name]);
  return svg(
    "svg",
    {
      class: "sweep-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": `Error against ${axis.label}`,
    },
    axes2d(axis, "error, mm", ticks),
    stated === null || stated === undefined
      ? null
      : svg("path", { class: "stated", d: `M${MARGIN.left} ${y(stated)}H${WIDTH - MARGIN.right}` }),
    svg("polyline", {
      stroke: "var(--line-strong)",
      points: sorted
        .map((point) => `${toX(shareOf(axis, point.values[axis.name]))},${y(point.error)}`)
        .join(" "),
    }),
    points.map((point) => {
      const x = toX(shareOf(axis, point.values[axis.name]));
      if (point.error === null) return cross(x, toY(0.03), pointTitle([axis], point));
      const first = point.number === best;
      return svg(
        "circle",
        {
          class: first ? "best" : "point",
          "data-point": point.number,
          cx: x,
          cy: y(point.error),
          r: first ? 5.5 : 3.5,
        },
        pointTitle([axis], point),
      );
    }),
  );
}

function heatMap(axes, points, range, best) {
  const [across, upright] = axes;
  const grid = axes.map((axis) => new Set(points.map(({ values }) => values[axis.name])).size);
  const even = grid[0] * grid[1] <= points.length * 1.05 && points.length > 3;
  const cell = grid.map(
    (count, index) =>
      (index ? HEIGHT - MARGIN.top - MARGIN.bottom : WIDTH - MARGIN.left - MARGIN.right) /
      Math.max(1, count),
  );
  const ticks = [0, 0.5, 1].map((share) => ({
    share,
    text: upright.plain(valueAt(upright, share)),
  }));
  const order = axes.map((axis) =>
    [...new Set(points.map(({ values }) => values[axis.name]))].sort((a, b) => a - b),
  );
  const spot = (point) => {
    let [x, y] = [
      toX(shareOf(across, point.values[across.name])),
      toY(shareOf(upright, point.values[upright.name])),
    ];
    if (even) {
      x = MARGIN.left + (order[0].indexOf(point.values[across.name]) + 0.5) * cell[0];
      y = HEIGHT - MARGIN.bottom - (order[1].indexOf(point.values[upright.name]) + 0.5) * cell[1];
    }
    if (point.error === null) return cross(x, y, pointTitle(axes, point));
    const said = { "data-point": point.number, fill: colour(point.error, range) };
    return even
      ? svg(
          "rect",
          {
            ...said,
            x: x - cell[0] / 2,
            y: y - cell[1] / 2,
            width: cell[0] + 0.4,
            height: cell[1] + 0.4,
          },
          pointTitle(axes, point),
        )
      : svg("circle", { ...said, cx: x, cy: y, r: 5 }, pointTitle(axes, point));
  };
  const first = points.find(({ number }) => number === best);
  const mark = first ? spot(first) : null;
  const centre = !mark
    ? null
    : even
      ? [+mark.getAttribute("x") + cell[0] / 2, +mark.getAttribute("y") + cell[1] / 2]
      : [mark.getAttribute("cx"), mark.getAttribute("cy")];
  return svg(
    "svg",
    {
      class: "sweep-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": `Error over ${across.label} and ${upright.label}`,
    },
    axes2d(across, upright.label + (upright.unit ? `, ${upright.unit}` : ""), ticks),
    points.map(spot),
    centre ? svg("circle", { class: "best", cx: centre[0], cy: centre[1], r: 5.5 }) : null,
  );
}

function parallelPlot(axes, points, range, best) {
  const x = (index) => 46 + (index * (WIDTH - 92)) / (axes.length - 1);
  const sorted = [...points].sort((a, b) => (b.error ?? Infinity) - (a.error ?? Infinity));
  return svg(
    "svg",
    {
      class: "sweep-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": "Parallel coordinates",
    },
    sorted.map((point) => {
      const way = axes
        .map((axis, index) => `${x(index)},${toY(shareOf(axis, point.values[axis.name]))}`)
        .join(" ");
      if (point.error === null)
        return svg(
          "polyline",
          { class: "failed", "data-failed": "", points: way, "stroke-dasharray": "3 3" },
          pointTitle(axes, point),
        );
      return svg(
        "polyline",
        {
          "data-point": point.number,
          points: way,
          ...(point.number === best ? { class: "chosen" } : { stroke: colour(point.error, range) }),
        },
        pointTitle(axes, point),
      );
    }),
    axes.map((axis, index) => [
      svg("path", { class: "axis", d: `M${x(index)} ${MARGIN.top}V${HEIGHT - MARGIN.bottom}` }),
      svg(
        "text",
        { x: x(index), y: HEIGHT - 20, "text-anchor": "middle" },
        `${axis.show(axis.low)}…${axis.show(axis.high)}`,
      ),
      svg("text", { x: x(index), y: HEIGHT - 5, "text-anchor": "middle" }, axis.label),
    ]),
  );
}
