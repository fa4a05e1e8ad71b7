// Plots of the correction panel: the validation error by epoch, and the ladder of errors with
// intervals and the noise floor.
import { element, svgElement } from "./dom.js";
import { formatPercent } from "./format.js";

/** @import { LadderPart, LadderSummary, Rung } from "./types.js" */

// Lengths in pixels.
const WIDTH = 380;
const HEIGHT = 170;
const MARGIN = { left: 44, right: 12, top: 10, bottom: 30 };
/** @type {Record<string, string>} */
const KINDS = { top: "pushes from above", side: "pushes into a side", drag: "drags" };
/** @type {Record<string, string>} */
const PARTS = {
  seen: "Kinds of motion that training has",
  unseen: "Kinds of motion that training never saw",
};
/** @type {Record<string, string>} */
const MODELS = { baseline: "Raw", extended: "Extended", true: "True" };
/** @type {Record<string, string>} */
const NETWORKS = { unet2d: "2D", unet3d: "3D", graph: "graph" };

/**
 * @param {Pick<Rung, "name" | "network">} rung
 * @returns {string}
 */
const shortName = ({ name, network }) => {
  const model = MODELS[name.split("_")[0]] ?? name;
  return network ? `${model} + ${NETWORKS[network.kind]} net` : model;
};

/**
 * @param {number} value
 * @returns {number}
 */
const threeDigits = (value) => +value.toPrecision(3);

/**
 * Create the plot of the validation error [mm] by epoch.
 * @param {number[][]} history epoch and error
 * @param {number} [without] error without a network [mm]
 * @returns {SVGElement}
 */
export function validationCurve(history, without) {
  const errors = history.map(([, error]) => error);
  const known = [...errors, ...(without ? [without] : [])];
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const room = Math.max(high - low, 0.02 * high) * 0.08;
  /**
   * @param {number} epoch
   * @returns {number}
   */
  const x = (epoch) =>
    MARGIN.left +
    (errors.length < 2 ? 0.5 : epoch / (errors.length - 1)) * (WIDTH - MARGIN.left - MARGIN.right);
  /**
   * @param {number} value
   * @returns {number}
   */
  const y = (value) =>
    MARGIN.top +
    ((high + room - value) / (high - low + 2 * room || 1)) * (HEIGHT - MARGIN.top - MARGIN.bottom);
  const best = errors.indexOf(Math.min(...errors));
  return svgElement(
    "svg",
    {
      class: "correction-plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label":
        "Validation error by epoch, best " + `${threeDigits(errors[best])} mm in epoch ${best + 1}`,
    },
    svgElement("path", {
      class: "axis",
      d: `M${MARGIN.left} ${MARGIN.top}V${HEIGHT - MARGIN.bottom}H${WIDTH - MARGIN.right}`,
    }),
    [low, high].map((value) =>
      svgElement(
        "text",
        { x: MARGIN.left - 6, y: y(value) + 4, "text-anchor": "end" },
        `${threeDigits(value)}`,
      ),
    ),
    svgElement(
      "text",
      { x: WIDTH / 2, y: HEIGHT - 6, "text-anchor": "middle" },
      `epoch 1 to ${errors.length}; mean distance in validation, mm`,
    ),
    without
      ? svgElement("path", {
          class: "without",
          d: `M${MARGIN.left} ${y(without)}H${WIDTH - MARGIN.right}`,
        })
      : null,
    without
      ? svgElement(
          "text",
          { x: WIDTH - MARGIN.right, y: y(without) + 13, "text-anchor": "end" },
          "without the network",
        )
      : null,
    svgElement("polyline", {
      points: errors.map((value, epoch) => `${x(epoch)},${y(value)}`).join(" "),
    }),
    svgElement(
      "circle",
      { class: "best", cx: x(best), cy: y(errors[best]), r: 4 },
      svgElement("title", {}, `epoch ${best + 1}: ${threeDigits(errors[best])} mm`),
    ),
  );
}

/**
 * Create the bars of every model's error with its interval, for kinds of motion that were trained
 * on and for those that were not.
 * @param {LadderSummary} summary
 * @returns {HTMLElement}
 */
export function ladderChart({ rungs, parts }) {
  const shown = parts.filter(({ part }) => part in PARTS);
  const groups = shown.length ? shown : parts.filter(({ part }) => part === "all");
  const most = Math.max(
    ...groups.flatMap(({ errors }) => Object.values(errors).map(({ high }) => high)),
  );
  return element(
    "div",
    { class: "rungs" },
    groups.map((one) =>
      element(
        "section",
        { "data-part": one.part },
        element(
          "h3",
          {},
          PARTS[one.part] ?? "All pushes",
          element(
            "small",
            {},
            `${one.kinds.map((kind) => KINDS[kind] ?? kind).join(", ")}; ${pushesText(one.probes)}`,
          ),
        ),
        rungs.map((rung) => ladderBar(rung, one, most)),
      ),
    ),
    element(
      "p",
      { class: "rungs-key" },
      element("i", {}),
      "below the grey edge lies the sensor's noise; whiskers: 95 % interval from drawing " +
        "pushes anew",
    ),
  );
}

/**
 * Say how many pushes there are; intervals come from drawing them anew, of which one says nothing.
 * @param {number} count
 * @returns {string}
 */
const pushesText = (count) =>
  count === 1 ? "1 push, so that no interval is known" : `${count} pushes`;

/**
 * @param {Rung} rung
 * @param {LadderPart} part
 * @param {number} most end of the bars' scale
 * @returns {HTMLElement}
 */
function ladderBar({ name, label, network }, { errors, probes, noise_floor: floor }, most) {
  const { error, low, high, removed } = errors[name];
  /**
   * @param {number} value
   * @returns {string}
   */
  const at = (value) => `${Math.min(100, (100 * value) / most)}%`;
  const colour = network ? "corrected" : name === "baseline" ? "raw" : "extended";
  const worse = (removed.value ?? 0) <= -0.005;
  const reduction =
    name === "baseline"
      ? ""
      : worse
        ? `makes it worse: ${errors.baseline.error.toFixed(2)} to ${error.toFixed(2)} mm`
        : `${formatPercent(removed.value)}${
            probes === 1 ? "" : ` (${formatPercent(removed.low)} to ${formatPercent(removed.high)})`
          }`;
  return element(
    "div",
    {
      class: "rung",
      "data-rung": name,
      title: `${label}: ${error.toFixed(3)} mm (${low.toFixed(3)} to ${high.toFixed(3)} mm)`,
    },
    element("span", {}, shortName({ name, network })),
    element(
      "div",
      { class: "bar" },
      element("i", { style: { width: at(error), background: `var(--${colour})` } }),
      element("i", { class: "noise", style: { width: at(floor) } }),
      element("i", {
        class: "whisker",
        style: { left: at(low), width: `calc(${at(high)} - ${at(low)})` },
      }),
    ),
    element("b", {}, `${error.toFixed(2)} mm`),
    element("small", {}, reduction),
  );
}
