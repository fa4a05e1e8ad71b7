// How each layer is drawn: what is chosen for all layers, and what a layer has of its own. The
// server applies the same rules to the request.
import { set, state } from "./store.js";

/** @import { LayerStyle, Model, Quantity, ViewRequest } from "./types.js" */

/** @type {Record<string, string>} */
export const LAYERS = {
  measured: "Measured cloud",
  raw: "Raw model",
  extended: "Extended model",
  corrected: "Corrected model",
  tool: "Tool",
  path: "Tool’s path",
  landmarks: "Touched landmarks",
  base: "Fixed base",
  lump: "Lump found",
};
/** @type {Model[]} */
export const MODELS = ["raw", "extended", "corrected"];

/**
 * Quantities that colours show; `factor` converts SI units to `unit`.
 * @type {Record<Quantity, { label: string, unit: string, factor: number }>}
 */
export const QUANTITIES = {
  error: { label: "Error", unit: "mm", factor: 1e3 },
  displacement: { label: "Displacement", unit: "mm", factor: 1e3 },
  energy: { label: "Energy density", unit: "J/m³", factor: 1 },
};

/** @returns {Model[]} */
const shownModels = () => [...MODELS].reverse().filter((model) => state().layers.includes(model));

/**
 * Return the model whose surface is in front, of those that are shown.
 * @returns {Model | null}
 */
const frontModel = () =>
  shownModels().find((model) => model === state().colour) ?? shownModels()[0] ?? null;

/**
 * @param {string} layer
 * @returns {number}
 */
export const opacity = (layer) => state().looks[layer]?.opacity ?? 1;

/**
 * @param {Model} model
 * @returns {boolean}
 */
export function isColoured(model) {
  return (
    state().looks[model]?.coloured ??
    (state().colour !== "plain" &&
      (state().side_by_side || (state().colour === model && model === frontModel())))
  );
}

/**
 * @param {Model} model
 * @returns {boolean}
 */
export function isWireframe(model) {
  return state().looks[model]?.lines ?? (!state().side_by_side && model !== frontModel());
}

/**
 * @param {string} layer
 * @param {LayerStyle} change
 */
export function setLayerStyle(layer, change) {
  set({ looks: { ...state().looks, [layer]: { ...state().looks[layer], ...change } } });
}

/**
 * Return why a layer cannot be shown; null where it can.
 * @param {string} layer
 * @returns {string | null}
 */
export function unavailableReason(layer) {
  const { heading, series } = state();
  if (layer === "measured" && heading && !heading.has_clouds)
    return "The dataset is not where this run says, so its clouds cannot be shown";
  if (!series) return null;
  if (isModel(layer) && !series.models.includes(layer))
    return layer === "corrected"
      ? "No correction network was trained for this run"
      : "This run does not hold the model";
  if (layer === "lump" && !series.lumps) return "Nothing of other stiffness was found in this run";
  if (layer === "landmarks" && !series.landmarks)
    return "This run does not say which landmarks were touched";
  return null;
}

/**
 * Return why a quantity cannot be shown; null where it can.
 * @param {Quantity} quantity
 * @returns {string | null}
 */
export function quantityUnavailableReason(quantity) {
  const { series } = state();
  return series?.limits[quantity] === null ? series.inside : null;
}

/**
 * Draw one model coloured and in front, the others as lines; "plain" colours none.
 * @param {string} colour
 */
export function colourBy(colour) {
  const layers =
    colour === "plain" || state().layers.includes(colour)
      ? state().layers
      : [...state().layers, colour];
  const looks = Object.fromEntries(
    Object.entries(state().looks).map(([layer, style]) => [
      layer,
      style.opacity ? { opacity: style.opacity } : {},
    ]),
  );
  set({ colour, layers: inDrawOrder(layers), looks });
}

/**
 * Sort layers as they are listed, and leave out unknown ones.
 * @param {string[]} layers
 * @returns {string[]}
 */
export const inDrawOrder = (layers) =>
  Object.keys(LAYERS).filter((layer) => layers.includes(layer));

/** @param {string} layer */
export function toggleLayer(layer) {
  const { layers } = state();
  set({
    layers: inDrawOrder(
      layers.includes(layer) ? layers.filter((other) => other !== layer) : [...layers, layer],
    ),
  });
}

/**
 * Return all that the server needs to draw the scene.
 * @returns {ViewRequest}
 */
export function viewRequest() {
  const {
    run,
    sequence,
    frame,
    layers,
    colour,
    quantity,
    ranges,
    limits,
    crop,
    side_by_side: aside,
    section,
    looks,
  } = state();
  const available = quantityUnavailableReason(quantity) ? "error" : quantity;
  const range = ranges[available] ?? "robust";
  return {
    run,
    sequence,
    frame,
    layers: inDrawOrder(layers),
    colour,
    quantity: available,
    scale: range === "fixed" ? "fixed" : "robust",
    limit: range === "manual" ? (limits[available] ?? null) : null,
    crop,
    side_by_side: aside,
    section: section?.on ? { axis: section.axis, at: section.at, flip: section.flip } : null,
    looks: Object.fromEntries(Object.entries(looks).filter(([layer]) => layer in LAYERS)),
  };
}

/**
 * @param {string} layer
 * @returns {layer is Model}
 */
export const isModel = (layer) => layer in { raw: 0, extended: 0, corrected: 0 };
