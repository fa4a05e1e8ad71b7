// The scene's legend: what the colours mean, with unit and range.
import { byId, element, fill, swatch } from "./dom.js";
import { isColoured, MODELS, QUANTITIES } from "./layer-styles.js";
import { verticalScaleBar } from "./colour-scale.js";
import { subscribe, set, state } from "./store.js";

/** @import { Quantity, Rgb } from "./types.js" */

/**
 * @typedef {object} Legend
 * @property {string} title
 * @property {[string, string] | null} ends words above and below a signed scale
 * @property {Rgb[]} bands
 * @property {number} low in `unit`
 * @property {number} high in `unit`
 * @property {number} factor from SI units to `unit`
 * @property {string} unit
 * @property {Quantity} quantity
 * @property {boolean} signed
 */

/**
 * Ranges of the colour scale with label and title.
 * @type {Record<string, [string, string]>}
 */
const RANGES = {
  robust: ["Robust", "Holds nearly all that occurs in the raw model of this sequence"],
  fixed: ["Fixed", "The same for all sequences of this diagnosis"],
  manual: ["Manual", "As you set it"],
};

/** Draw the legend whenever what it shows has changed. */
export function start() {
  subscribe(
    ["colour", "quantity", "ranges", "limits", "rendered", "palette", "trial", "looks", "live"],
    draw,
  );
}

/**
 * Return what the legend shows; null where nothing is coloured.
 * @returns {Legend | null}
 */
export function legendContent() {
  const { rendered, palette, trial, colour } = state();
  const { quantity, limit } = rendered?.drawn ?? {};
  if (!palette || !rendered?.view || !quantity || !limit) return null;
  const shown = rendered.view.layers;
  const { unit, factor, label } = QUANTITIES[quantity];
  const names = MODELS.filter((model) => shown.includes(model) && isColoured(model));
  const one = state().live
    ? "live"
    : trial && colour === "extended"
      ? "what if"
      : names.length === 1
        ? `${names[0]} model`
        : "model";
  const signed = quantity === "error";
  return {
    title: signed ? `Measured − ${one}, ${unit}` : `${label}, ${unit}`,
    ends: signed ? ["measured higher", "measured deeper"] : null,
    bands: signed ? palette.signed : palette.sequential,
    low: signed ? -limit * factor : 0,
    high: limit * factor,
    factor,
    unit,
    quantity,
    signed,
  };
}

/** Draw the legend, unless its number field has the focus. */
function draw() {
  const box = byId("legend");
  const what = legendContent();
  box.hidden = what === null;
  const focused = document.activeElement;
  const typing = focused instanceof HTMLInputElement && focused.type === "number";
  if (!what || (typing && box.contains(focused))) return;
  const { ranges, limits } = state();
  const range = ranges[what.quantity] ?? "robust";
  /** @param {string} name */
  const setRange = (name) =>
    set({
      ranges: { ...ranges, [what.quantity]: name },
      limits: name === "manual" ? { ...limits, [what.quantity]: what.high / what.factor } : limits,
    });
  fill(
    box,
    element("div", { class: "title" }, what.title),
    what.ends ? element("div", { class: "ends" }, what.ends[0]) : null,
    verticalScaleBar(what.bands, what.low, what.high),
    what.ends ? element("div", { class: "ends" }, what.ends[1]) : null,
    element(
      "div",
      { class: "range" },
      element(
        "select",
        {
          "aria-label": "Range of the scale",
          title: RANGES[range][1],
          onchange: (event) => {
            setRange(event.target.value);
            event.target.blur();
          },
        },
        Object.entries(RANGES).map(([name, [label, title]]) =>
          element("option", { value: name, selected: name === range, title }, label),
        ),
      ),
      range === "manual" ? limitField(what) : null,
    ),
    what.signed ? element("div", { class: "unseen" }, swatch("unseen"), "not seen") : null,
  );
}

/**
 * Create the field for the end of a manual scale.
 * @param {Legend} legend
 * @returns {HTMLElement}
 */
function limitField({ high, factor, unit, quantity, signed }) {
  const label = `End of the scale in ${unit}`;
  return element(
    "label",
    {},
    signed ? "± " : "0 to ",
    element("input", {
      type: "number",
      min: 0,
      step: "any",
      value: +high.toPrecision(4),
      "aria-label": label,
      title: label,
      onchange: (event) => {
        const value = +event.target.value;
        event.target.blur();
        if (value > 0 && value / factor <= 1e9)
          set({ limits: { ...state().limits, [quantity]: value / factor } });
      },
    }),
  );
}
