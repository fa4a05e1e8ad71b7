// The points of a sweep: against one parameter, as a map over two, as parallel lines over more. Failed points are crosses.
import { element } from "./dom.js";
import { mm } from "./format.js";

const WIDTH = 380;
const HEIGHT = 230;
const BOX = { left: 56, right: 14, top: 10, bottom: 34 };
const LOW = [13, 148, 136];
const HIGH = [224, 152, 32];

function svg(name, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children.flat(2).filter((child) => child !== null));
  return node;
}

/** The picture of these points; `axes` have name, label, low, high, log, show(value). */
export function plotOf(axes, points, stated, best) {
  if (axes.length === 1) return line(axes[0], points, stated, best);
  const known = points.map(({ error }) => error).filter((error) => error !== null);
  const range = known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
  const picture =
    axes.length === 2 ? heat(axes, points, range, best) : parallel(axes, points, range, best);
  return element(
    "div",
    {},
    picture,
    element(
      "div",
      { class: "sweep-scale" },
      element("span", {}, mm4(range[0])),
      element("i", { style: { background: `linear-gradient(90deg, ${rgb(LOW)}, ${rgb(HIGH)})` } }),
      element("span", {}, mm4(range[1])),
    ),
  );
}

/** A change of the error: two digits, and nothing finer than a thousandth of a millimetre. */
export const change = (metres) =>
  Math.abs(metres) < 1e-6 ? "under 0.001 mm" : `${+(metres * 1e3).toPrecision(2)} mm`;

export const mm4 = (metres) =>
  metres === null || metres === undefined ? "–" : `${(metres * 1e3).toPrecision(4)} mm`;

const rgb = (parts) => `rgb(${parts.map(Math.round).join(" ")})`;

function colour(error, [low, high]) {
  const share = high > low ? (error - low) / (high - low) : 0;
  return rgb(LOW.map((part, index) => part + share * (HIGH[index] - part)));
}

const place = ({ low, high, log }, value) =>
  log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);

const title = (axes, point) =>
  svg(
    "title",
    {},
    `${axes.map((axis) => `${axis.label} ${axis.show(point.values[axis.name])}`).join(", ")}: ${point.error === null ? `failed: ${point.failure}` : mm4(point.error)}`,
  );

const cross = (x, y, ...inside) =>
  svg(
    "path",
    { class: "failed", "data-failed": "", d: `M${x - 4} ${y - 4}l8 8M${x + 4} ${y - 4}l-8 8` },
    ...inside,
  );

function frame(axis, upright, ticks) {
  const { left, right, top, bottom } = BOX;
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
        axis.show(at(axis, share)),
      ),
    ),
    svg("text", { x: across(0.5), y: HEIGHT - 4, "text-anchor": "middle" }, axis.label),
    ...ticks.map(({ share, text }) =>
      svg("text", { x: left - 6, y: high(share) + 4, "text-anchor": "end" }, text),
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

const at = ({ low, high: top, log }, share) =>
  log ? low * (top / low) ** share : low + share * (top - low);
const high = (share) => HEIGHT - BOX.bottom - share * (HEIGHT - BOX.top - BOX.bottom);
const wide = (share) => BOX.left + share * (WIDTH - BOX.left - BOX.right);

function line(axis, points, stated, best) {
  const known = points.filter(({ error }) => error !== null);
  const errors = [
    ...known.map(({ error }) => error),
    ...(stated === null || stated === undefined ? [] : [stated]),
  ];
  const [least, most] = errors.length ? [Math.min(...errors), Math.max(...errors)] : [0, 1e-3];
  const room = Math.max((most - least) * 0.12, most * 0.02);
  const [from, to] = [Math.max(0, least - room), most + room];
  const y = (error) => high((error - from) / (to - from));
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
    frame(axis, "error, mm", ticks),
    stated === null || stated === undefined
      ? null
      : svg("path", { class: "stated", d: `M${BOX.left} ${y(stated)}H${WIDTH - BOX.right}` }),
    svg("polyline", {
      stroke: "var(--line-strong)",
      points: sorted
        .map((point) => `${wide(place(axis, point.values[axis.name]))},${y(point.error)}`)
        .join(" "),
    }),
    points.map((point) => {
      const x = wide(place(axis, point.values[axis.name]));
      if (point.error === null) return cross(x, high(0.03), title([axis], point));
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
        title([axis], point),
      );
    }),
  );
}

function heat(axes, points, range, best) {
  const [across, upright] = axes;
  const grid = axes.map((axis) => new Set(points.map(({ values }) => values[axis.name])).size);
  const even = grid[0] * grid[1] <= points.length * 1.05 && points.length > 3;
  const cell = grid.map(
    (count, index) =>
      (index ? HEIGHT - BOX.top - BOX.bottom : WIDTH - BOX.left - BOX.right) / Math.max(1, count),
  );
  const ticks = [0, 0.5, 1].map((share) => ({ share, text: upright.plain(at(upright, share)) }));
  const order = axes.map((axis) =>
    [...new Set(points.map(({ values }) => values[axis.name]))].sort((a, b) => a - b),
  );
  const spot = (point) => {
    let [x, y] = [
      wide(place(across, point.values[across.name])),
      high(place(upright, point.values[upright.name])),
    ];
    if (even) {
      x = BOX.left + (order[0].indexOf(point.values[across.name]) + 0.5) * cell[0];
      y = HEIGHT - BOX.bottom - (order[1].indexOf(point.values[upright.name]) + 0.5) * cell[1];
    }
    if (point.error === null) return cross(x, y, title(axes, point));
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
          title(axes, point),
        )
      : svg("circle", { ...said, cx: x, cy: y, r: 5 }, title(axes, point));
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
    frame(across, upright.label + (upright.unit ? `, ${upright.unit}` : ""), ticks),
    points.map(spot),
    centre ? svg("circle", { class: "best", cx: centre[0], cy: centre[1], r: 5.5 }) : null,
  );
}

function parallel(axes, points, range, best) {
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
        .map((axis, index) => `${x(index)},${high(place(axis, point.values[axis.name]))}`)
        .join(" ");
      if (point.error === null)
        return svg(
          "polyline",
          { class: "failed", "data-failed": "", points: way, "stroke-dasharray": "3 3" },
          title(axes, point),
        );
      return svg(
        "polyline",
        {
          "data-point": point.number,
          points: way,
          ...(point.number === best ? { class: "chosen" } : { stroke: colour(point.error, range) }),
        },
        title(axes, point),
      );
    }),
    axes.map((axis, index) => [
      svg("path", { class: "axis", d: `M${x(index)} ${BOX.top}V${HEIGHT - BOX.bottom}` }),
      svg(
        "text",
        { x: x(index), y: HEIGHT - 20, "text-anchor": "middle" },
        `${axis.show(axis.low)}…${axis.show(axis.high)}`,
      ),
      svg("text", { x: x(index), y: HEIGHT - 5, "text-anchor": "middle" }, axis.label),
    ]),
  );
}
