// Layers: switches in the toolbar, and a panel below it for how each layer is drawn.
import { byId, element, fill, icon, swatch } from "./dom.js";
import {
  unavailableReason,
  colourBy,
  isColoured,
  LAYERS,
  isWireframe,
  isModel,
  MODELS,
  quantityUnavailableReason,
  opacity,
  QUANTITIES,
  setLayerStyle,
  toggleLayer,
} from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";

/** @import { Model, Quantity } from "./types.js" */

const CHIPS = {
  measured: "Measured",
  raw: "Raw",
  extended: "Extended",
  corrected: "Corrected",
  tool: "Tool",
};
const quantities = /** @type {[Quantity, { label: string }][]} */ (Object.entries(QUANTITIES));
const SEGMENTS = { plain: "Plain", raw: "Raw", extended: "Extended", corrected: "Corrected" };

/** Set the toolbar's switches and the panel up. */
export function start() {
  const button = byId("layers-button");
  fill(button, icon("layers"), "Layers");
  button.addEventListener("click", () => setOpen(box().hidden));
  document.addEventListener("pointerdown", (event) => {
    const target = /** @type {Node} */ (event.target);
    if (!box().hidden && !box().contains(target) && !button.contains(target)) setOpen(false);
  });
  window.addEventListener("blur", () => {
    if (document.activeElement?.id === "viewer") setOpen(false);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && !box().hidden) {
      setOpen(false);
      button.focus();
    }
  });
  subscribe(["layers", "colour", "quantity", "series", "heading"], drawToolbar);
  subscribe(
    ["layers", "colour", "quantity", "looks", "series", "side_by_side", "heading"],
    drawRows,
  );
  drawToolbar();
}

const box = () => byId("layers-panel");

/**
 * Open or close the panel.
 * @param {boolean} open
 */
function setOpen(open) {
  box().hidden = !open;
  byId("layers-button").setAttribute("aria-expanded", String(open));
  if (open) {
    drawRows();
    /** @type {HTMLElement | null} */ (box().querySelector("input, button"))?.focus();
  }
}

/**
 * Return whether the run holds a model; true while nobody knows.
 * @param {string} name
 * @returns {boolean}
 */
const isAvailable = (name) =>
  !isModel(name) || !state().series || Boolean(state().series?.models.includes(name));

function drawToolbar() {
  const { layers, colour, quantity, series } = state();
  document
    .querySelector(".toolbar")
    ?.classList.toggle("full", Boolean(series?.models.includes("corrected")));
  fill(
    "layers",
    Object.entries(CHIPS)
      .filter(([name]) => name !== "corrected" || series?.models.includes(name))
      .map(([name, label]) =>
        element(
          "button",
          {
            class: "chip",
            type: "button",
            disabled: unavailableReason(name) !== null,
            title: unavailableReason(name) ?? LAYERS[name],
            "aria-pressed": String(layers.includes(name)),
            "data-layer": name,
            onclick: () => toggleLayer(name),
          },
          swatch(name),
          label,
        ),
      ),
  );
  fill(
    "quantity",
    quantities.map(([name, { label }]) =>
      element(
        "option",
        {
          value: name,
          selected: name === quantity,
          disabled: quantityUnavailableReason(name) !== null,
          title: quantityUnavailableReason(name),
        },
        label,
      ),
    ),
  );
  byId("quantity").title = quantityUnavailableReason("energy")
    ? `Energy density: ${quantityUnavailableReason("energy")}`
    : "What the colours show";
  fill(
    "colouring",
    Object.entries(SEGMENTS)
      .filter(
        ([name]) => name === "plain" || (isAvailable(name) && (name !== "corrected" || series)),
      )
      .map(([name, label]) =>
        element(
          "button",
          {
            type: "button",
            role: "radio",
            "aria-checked": String(colour === name),
            "data-colour": name,
            title: name === "plain" ? "Each model in its own colour" : `Colour the ${name} model`,
            onclick: () => colourBy(name),
          },
          label,
        ),
      ),
  );
}

/** Set the choice of the quantity up that colours show. */
export function startQuantity() {
  const select = byId("quantity", HTMLSelectElement);
  select.addEventListener("change", () => {
    set({ quantity: /** @type {Quantity} */ (select.value) });
    if (state().colour === "plain" && !MODELS.some(isColoured)) colourBy("raw");
    select.blur();
  });
}

/** Draw the panel's rows, unless a slider is being dragged, and keep the focus. */
function drawRows() {
  if (box().hidden) return;
  const active = document.activeElement;
  const { of: focused, kind } = active instanceof HTMLElement ? active.dataset : {};
  if (kind === "opacity") return; // a slider that is dragged stays as it is
  fill(
    box(),
    element(
      "div",
      { class: "layer-row head" },
      element("span", {}, "Layer"),
      element("span", {}, "Colour by"),
      element("span", {}, "Lines"),
      element("span", {}, "Opacity"),
    ),
    Object.keys(LAYERS).map(row),
    element(
      "div",
      { class: "layer-foot" },
      element(
        "button",
        {
          class: "button small",
          type: "button",
          onclick: () =>
            set({
              looks: {},
              layers: ["measured", "raw", "tool", "base"],
              colour: "raw",
              quantity: "error",
              ranges: {},
              side_by_side: false,
              section: null,
            }),
        },
        "As at first",
      ),
      element(
        "span",
        { class: "muted" },
        "Coloured layers share one quantity and one scale, so that they can be compared.",
      ),
    ),
  );
  const again = focused ? box().querySelector(`[data-of="${focused}"][data-kind="${kind}"]`) : null;
  if (again instanceof HTMLElement) again.focus();
}

/**
 * @param {string} name
 * @returns {HTMLElement}
 */
function row(name) {
  const why = unavailableReason(name);
  const shown = state().layers.includes(name) && why === null;
  const model = isModel(name);
  return element(
    "div",
    { class: shown ? "layer-row" : "layer-row off", title: why, "data-row": name },
    element(
      "label",
      { class: "whatif-switch" },
      element("input", {
        type: "checkbox",
        role: "switch",
        checked: shown,
        disabled: why !== null,
        "data-of": name,
        "data-kind": "shown",
        onchange: () => toggleLayer(name),
      }),
      swatch(name),
      LAYERS[name],
    ),
    model ? colourSelect(name, shown) : element("span"),
    model
      ? element("input", {
          type: "checkbox",
          "aria-label": `${LAYERS[name]} as lines`,
          checked: isWireframe(name),
          disabled: !shown,
          "data-of": name,
          "data-kind": "lines",
          onchange: (event) => setLayerStyle(name, { lines: event.target.checked }),
        })
      : element("span"),
    ["path", "landmarks", "base"].includes(name) ? element("span") : opacitySlider(name, shown),
  );
}

/**
 * @param {Model} name
 * @param {boolean} shown
 * @returns {HTMLElement}
 */
function colourSelect(name, shown) {
  const value = isColoured(name) ? state().quantity : "plain";
  return element(
    "select",
    {
      "aria-label": `Colour of the ${LAYERS[name].toLowerCase()}`,
      disabled: !shown,
      "data-of": name,
      "data-kind": "colour",
      onchange: (event) => {
        const plain = event.target.value === "plain";
        if (!plain) set({ quantity: /** @type {Quantity} */ (event.target.value) });
        setLayerStyle(name, plain ? { coloured: false } : { coloured: true, lines: false });
      },
    },
    element("option", { value: "plain", selected: value === "plain" }, "Plain"),
    quantities.map(([quantity, { label }]) =>
      element(
        "option",
        {
          value: quantity,
          selected: value === quantity,
          disabled: quantityUnavailableReason(quantity) !== null,
          title: quantityUnavailableReason(quantity),
        },
        label,
      ),
    ),
  );
}

/**
 * @param {string} name
 * @param {boolean} shown
 * @returns {HTMLElement}
 */
function opacitySlider(name, shown) {
  const kind = name === "measured" ? "Density" : "Opacity";
  const bar = element("input", {
    type: "range",
    min: 5,
    max: 100,
    step: 5,
    value: Math.round(100 * opacity(name)),
    disabled: !shown || (isModel(name) && isWireframe(name)),
    "aria-label": `${kind} of the ${LAYERS[name].toLowerCase()}`,
    title: name === "measured" ? "Share of the points that are drawn" : null,
    "data-of": name,
    "data-kind": "opacity",
    oninput: (event) => setLayerStyle(name, { opacity: +event.target.value / 100 }),
  });
  bar.addEventListener("change", () => bar.blur());
  return bar;
}
