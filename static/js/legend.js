// The one legend: what the colours mean, with its unit and range.
import { element, swatch } from "./dom.js";
import { fill } from "./dom.js";
import { isColoured, MODELS, QUANTITIES } from "./layer-styles.js";
import { verticalScaleBar } from "./colour-scale.js";
import { subscribe, set, state } from "./store.js";

const RANGES = {
  robust: ["Robust", "Holds nearly all that occurs in the raw model of this sequence"],
  fixed: ["Fixed", "The same for all sequences of this diagnosis"],
  manual: ["Manual", "As you set it"],
};

export function start() {
  subscribe(
    ["colour", "quantity", "ranges", "limits", "held", "palette", "trial", "looks", "live"],
    draw,
  );
}

/** What the legend says, for whoever draws it: null where nothing is coloured. */
export function legendContent() {
  const { held, palette, trial, colour } = state();
  const { quantity, limit } = held?.drawn ?? {};
  if (!palette || !quantity || !limit) return null;
  const { unit, factor, label } = QUANTITIES[quantity];
  const names = MODELS.filter((model) => held.view.layers.includes(model) && isColoured(model));
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

function draw() {
  const box = document.getElementById("legend");
  const what = legendContent();
  box.hidden = what === null;
  if (
    box.hidden ||
    (box.contains(document.activeElement) && document.activeElement.type === "number")
  )
    return;
  const { ranges, limits } = state();
  const range = ranges[what.quantity] ?? "robust";
  const setRange = (wanted) =>
    set({
      ranges: { ...ranges, [what.quantity]: wanted },
      limits:
        wanted === "manual" ? { ...limits, [what.quantity]: what.high / what.factor } : limits,
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
