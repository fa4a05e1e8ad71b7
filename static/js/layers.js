// Which layers are shown and how: switches in the toolbar, everything else in a panel that opens below them.
import { element, fill, icon, swatch } from "./dom.js";
import {
  unavailableReason,
  colourBy,
  isColoured,
  LAYERS,
  isWireframe,
  MODELS,
  quantityUnavailableReason,
  opacity,
  QUANTITIES,
  setLayerStyle,
  toggleLayer,
} from "./layer-styles.js";
import { subscribe, set, state } from "./store.js";

const CHIPS = {
  measured: "Measured",
  raw: "Raw",
  extended: "Extended",
  corrected: "Corrected",
  tool: "Tool",
};
const SEGMENTS = { plain: "Plain", raw: "Raw", extended: "Extended", corrected: "Corrected" };

export function start() {
  const button = fill("layers-button", icon("layers"), "Layers");
  button.addEventListener("click", () => setOpen(box().hidden));
  document.addEventListener("pointerdown", (event) => {
    if (!box().hidden && !box().contains(event.target) && !button.contains(event.target))
      setOpen(false);
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

const box = () => document.getElementById("layers-panel");

function setOpen(wanted) {
  box().hidden = !wanted;
  document.getElementById("layers-button").setAttribute("aria-expanded", String(wanted));
  if (wanted) {
    drawRows();
    box().querySelector("input, button")?.focus();
  }
}

const isAvailable = (model) =>
  !MODELS.includes(model) || !state().series || state().series.models.includes(model);

function drawToolbar() {
  const { layers, colour, quantity, series } = state();
  document
    .querySelector(".toolbar")
    .classList.toggle("full", Boolean(series?.models.includes("corrected")));
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
    Object.entries(QUANTITIES).map(([name, { label }]) =>
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
  document.getElementById("quantity").title = quantityUnavailableReason("energy")
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

export function startQuantity() {
  document.getElementById("quantity").addEventListener("change", (event) => {
    set({ quantity: event.target.value });
    if (state().colour === "plain" && !MODELS.some(isColoured)) colourBy("raw");
    event.target.blur();
  });
}

function drawRows() {
  if (box().hidden) return;
  const focused = document.activeElement?.dataset?.of;
  const kind = document.activeElement?.dataset?.kind;
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
  if (focused) box().querySelector(`[data-of="${focused}"][data-kind="${kind}"]`)?.focus();
}

function row(name) {
  const why = unavailableReason(name);
  const shown = state().layers.includes(name) && why === null;
  const model = MODELS.includes(name);
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
        if (!plain) set({ quantity: event.target.value });
        setLayerStyle(name, plain ? { coloured: false } : { coloured: true, lines: false });
      },
    },
    element("option", { value: "plain", selected: value === "plain" }, "Plain"),
    Object.entries(QUANTITIES).map(([quantity, { label }]) =>
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

function opacitySlider(name, shown) {
  const bar = element("input", {
    type: "range",
    min: 5,
    max: 100,
    step: 5,
    value: Math.round(100 * opacity(name)),
    disabled: !shown || (MODELS.includes(name) && isWireframe(name)),
    "aria-label": `${name === "measured" ? "Density" : "Opacity"} of the ${LAYERS[name].toLowerCase()}`,
    title: name === "measured" ? "Share of the points that are drawn" : null,
    "data-of": name,
    "data-kind": "opacity",
    oninput: (event) => setLayerStyle(name, { opacity: +event.target.value / 100 }),
  });
  bar.addEventListener("change", () => bar.blur());
  return bar;
}
