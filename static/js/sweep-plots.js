// Plots of a sweep's points: against one parameter, as a map over two, as parallel coordinates
// over more. Failed points are crosses.
import { element, svgElement } from "./dom.js";
/** @import { PlotAxis, SweepPoint } from "./types.js" */

/** @typedef {[number, number]} Range least and largest error [m] */

// Lengths in pixels.
const WIDTH = 380;
const HEIGHT = 230;
const MARGIN = { left: 56, right: 14, top: 10, bottom: 34 };
// Colours of the least and the largest error.
const LOW = [13, 148, 136];
const HIGH = [224, 152, 32];

/**
 * Create the plot of points.
 * @param {PlotAxis[]} axes
 * @param {SweepPoint[]} points
 * @param {number | null} stated error of the setup as stated [m]
 * @param {number} [best] number of the best point
 * @param {number} [atRest] error of the untouched phantom [m]
 * @returns {Element}
 */
export function sweepPlot(axes, points, stated, best, atRest) {
  if (axes.length === 1) return linePlot(axes[0], points, stated, best, atRest);
  const known = points.map(({ error }) => error).filter(isKnown);
  /** @type {Range} */
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

/**
 * Format a change of the error [m]: two digits, and nothing finer than 0.001 mm.
 * @param {number} metres
 * @returns {string}
 */
export const formatErrorChange = (metres) =>
  Math.abs(metres) < 1e-6 ? "under 0.001 mm" : `${+(metres * 1e3).toPrecision(2)} mm`;

/**
 * Format an error [m] with four digits.
 * @param {number | null | undefined} metres
 * @returns {string}
 */
export const formatError = (metres) =>
  metres === null || metres === undefined ? "–" : `${(metres * 1e3).toPrecision(4)} mm`;

/**
 * @param {number[]} parts
 * @returns {string}
 */
const rgb = (parts) => `rgb(${parts.map(Math.round).join(" ")})`;

/**
 * @param {number} error
 * @param {Range} range
 * @returns {string}
 */
function colour(error, [low, high]) {
  const share = high > low ? (error - low) / (high - low) : 0;
  return rgb(LOW.map((part, index) => part + share * (HIGH[index] - part)));
}

/**
 * Return where a value lies between the ends of an axis, 0 to 1.
 * @param {PlotAxis} axis
 * @param {number} value
 * @returns {number}
 */
const shareOf = ({ low, high, log }, value) =>
  log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);

/**
 * Create the text that is shown when the pointer rests on a point.
 * @param {PlotAxis[]} axes
 * @param {SweepPoint} point
 * @returns {SVGElement}
 */
const pointTitle = (axes, point) => {
  const where = axes.map((axis) => `${axis.label} ${axis.show(point.values[axis.name])}`);
  const result = point.error === null ? `failed: ${point.failure}` : formatError(point.error);
  return svgElement("title", {}, `${where.join(", ")}: ${result}`);
};

/**
 * Create the mark of a failed point.
 * @param {number} x
 * @param {number} y
 * @param {SVGElement} title
 * @returns {SVGElement}
 */
const cross = (x, y, title) =>
  svgElement(
    "path",
    { class: "failed", "data-failed": "", d: `M${x - 4} ${y - 4}l8 8M${x + 4} ${y - 4}l-8 8` },
    title,
  );

/**
 * Create both axes with their numbers.
 * @param {PlotAxis} axis
 * @param {string} upright label of the vertical axis
 * @param {{ share: number, text: string }[]} ticks
 * @returns {SVGElement[]}
 */
function axes2d(axis, upright, ticks) {
  const { left, right, top, bottom } = MARGIN;
  return [
    svgElement("path", {
      class: "axis",
      fill: "none",
      d: `M${left} ${top}V${HEIGHT - bottom}H${WIDTH - right}`,
    }),
    ...[0, 0.5, 1].map((share) =>
      svgElement(
        "text",
        {
          x: toX(share),
          y: HEIGHT - bottom + 14,
          "text-anchor": ["start", "middle", "end"][share * 2],
        },
        axis.show(valueAt(axis, share)),
      ),
    ),
    svgElement("text", { x: toX(0.5), y: HEIGHT - 4, "text-anchor": "middle" }, axis.label),
    ...ticks.map(({ share, text }) =>
      svgElement("text", { x: left - 6, y: toY(share) + 4, "text-anchor": "end" }, text),
    ),
    svgElement(
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

/**
 * @param {PlotAxis} axis
 * @param {number} share
 * @returns {number}
 */
const valueAt = ({ low, high: top, log }, share) =>
  log ? low * (top / low) ** share : low + share * (top - low);

/**
 * Return the pixel of a share of the height.
 * @param {number} share
 * @returns {number}
 */
const toY = (share) => HEIGHT - MARGIN.bottom - share * (HEIGHT - MARGIN.top - MARGIN.bottom);

/**
 * Return the pixel of a share of the width.
 * @param {number} share
 * @returns {number}
 */
const toX = (share) => MARGIN.left + share * (WIDTH - MARGIN.left - MARGIN.right);

/**
 * @param {PlotAxis} axis
 * @param {SweepPoint[]} points
 * @param {number | null} stated
 * @param {number} [best]
 * @param {number} [atRest]
 * @returns {SVGElement}
 */
function linePlot(axis, points, stated, best, atRest) {
  const known = points.flatMap(({ error, values }) =>
    isKnown(error) ? [{ error, value: values[axis.name] }] : [],
  );
  const levels = [stated, atRest ?? null].filter(isKnown);
  const errors = [...known.map(({ error }) => error), ...levels];
  const [least, most] = errors.length ? [Math.min(...errors), Math.max(...errors)] : [0, 1e-3];
  const room = Math.max((most - least) * 0.12, most * 0.02);
  const [from, to] = [Math.max(0, least - room), most + room];
  /**
   * @param {number} error
   * @returns {number}
   */
  const y = (error) => toY((error - from) / (to - from));
  const ticks = [0, 0.5, 1].map((share) => ({
    share,
    text: ((from + share * (to - from)) * 1e3).toPrecision(3),
  }));
  const sorted = [...known].sort((a, b) => a.value - b.value);
  return svgElement(
    "svg",
    {
      class: "sweep-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": `Error against ${axis.label}`,
    },
    axes2d(axis, "error, mm", ticks),
    stated === null
      ? null
      : svgElement("path", {
          class: "stated",
          d: `M${MARGIN.left} ${y(stated)}H${WIDTH - MARGIN.right}`,
        }),
    atRest === undefined
      ? null
      : svgElement("path", {
          class: "at-rest",
          d: `M${MARGIN.left} ${y(atRest)}H${WIDTH - MARGIN.right}`,
        }),
    statedMark(axis),
    svgElement("polyline", {
      stroke: "var(--line-strong)",
      points: sorted
        .map(({ value, error }) => `${toX(shareOf(axis, value))},${y(error)}`)
        .join(" "),
    }),
    points.map((point) => {
      const x = toX(shareOf(axis, point.values[axis.name]));
      if (point.error === null) return cross(x, toY(0.03), pointTitle([axis], point));
      const first = point.number === best;
      return svgElement(
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

/**
 * Create the mark of a parameter's stated value on the lower axis; null outside of the range.
 * @param {PlotAxis} axis
 * @returns {SVGElement | null}
 */
function statedMark(axis) {
  const { stated, low, high } = axis;
  if (stated === undefined || stated < low || stated > high) return null;
  const [x, y] = [toX(shareOf(axis, stated)), toY(0)];
  return svgElement(
    "path",
    { class: "stated-value", "data-stated": stated, d: `M${x} ${y}l-5 9h10z` },
    svgElement("title", {}, `stated: ${axis.show(stated)}`),
  );
}

/**
 * @param {PlotAxis[]} axes
 * @param {SweepPoint[]} points
 * @param {Range} range
 * @param {number} [best]
 * @returns {SVGElement}
 */
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
  /**
   * Create a point's cell of the grid, or a circle where the points form no grid.
   * @param {SweepPoint} point
   * @returns {SVGElement}
   */
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
    const attributes = { "data-point": point.number, fill: colour(point.error, range) };
    return even
      ? svgElement(
          "rect",
          {
            ...attributes,
            x: x - cell[0] / 2,
            y: y - cell[1] / 2,
            width: cell[0] + 0.4,
            height: cell[1] + 0.4,
          },
          pointTitle(axes, point),
        )
      : svgElement("circle", { ...attributes, cx: x, cy: y, r: 5 }, pointTitle(axes, point));
  };
  const first = points.find(({ number }) => number === best);
  const mark = first ? spot(first) : null;
  /** @param {string} name */
  const number = (name) => Number(mark?.getAttribute(name));
  const centre = even
    ? [number("x") + cell[0] / 2, number("y") + cell[1] / 2]
    : [number("cx"), number("cy")];
  return svgElement(
    "svg",
    {
      class: "sweep-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": `Error over ${across.label} and ${upright.label}`,
    },
    axes2d(across, upright.label + (upright.unit ? `, ${upright.unit}` : ""), ticks),
    statedMark(across),
    points.map(spot),
    mark
      ? svgElement("circle", { class: "best over", cx: centre[0], cy: centre[1], r: 5.5 })
      : null,
  );
}

/**
 * @param {PlotAxis[]} axes
 * @param {SweepPoint[]} points
 * @param {Range} range
 * @param {number} [best]
 * @returns {SVGElement}
 */
function parallelPlot(axes, points, range, best) {
  /** @param {number} index */
  const x = (index) => 46 + (index * (WIDTH - 92)) / (axes.length - 1);
  const sorted = [...points].sort((a, b) => (b.error ?? Infinity) - (a.error ?? Infinity));
  return svgElement(
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
        return svgElement(
          "polyline",
          { class: "failed", "data-failed": "", points: way, "stroke-dasharray": "3 3" },
          pointTitle(axes, point),
        );
      return svgElement(
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
      svgElement("path", {
        class: "axis",
        d: `M${x(index)} ${MARGIN.top}V${HEIGHT - MARGIN.bottom}`,
      }),
      svgElement(
        "text",
        { x: x(index), y: HEIGHT - 20, "text-anchor": "middle" },
        `${axis.show(axis.low)}…${axis.show(axis.high)}`,
      ),
      svgElement("text", { x: x(index), y: HEIGHT - 5, "text-anchor": "middle" }, axis.label),
    ]),
  );
}

/**
 * @param {number | null} error
 * @returns {error is number}
 */
function isKnown(error) {
  return error !== null;
}
