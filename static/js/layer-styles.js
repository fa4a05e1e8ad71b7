// How each layer is drawn: what is chosen for all, and what a layer has of its own. The server has the same rules in app/view.py.
import { set, state } from "./store.js";

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
export const MODELS = ["raw", "extended", "corrected"];
export const QUANTITIES = {
  error: { label: "Error", unit: "mm", factor: 1e3 },
  displacement: { label: "Displacement", unit: "mm", factor: 1e3 },
  energy: { label: "Energy density", unit: "J/m³", factor: 1 },
};

const shownModels = () => [...MODELS].reverse().filter((model) => state().layers.includes(model));

/** Of the models that are shown, the one whose surface lies in front. */
const frontModel = () =>
  shownModels().find((model) => model === state().colour) ?? shownModels()[0] ?? null;

export const opacity = (layer) => state().looks[layer]?.opacity ?? 1;

export function isColoured(model) {
  return (
    state().looks[model]?.coloured ??
    (state().colour !== "plain" &&
      (state().side_by_side || (state().colour === model && model === frontModel())))
  );
}

export function isWireframe(model) {
  return state().looks[model]?.lines ?? (!state().side_by_side && model !== frontModel());
}

export function setLayerStyle(layer, change) {
  set({ looks: { ...state().looks, [layer]: { ...state().looks[layer], ...change } } });
}

/** Why a layer cannot be shown here; null where it can. */
export function unavailableReason(layer) {
  const { heading, series } = state();
  if (layer === "measured" && heading && !heading.has_clouds)
    return "The dataset is not where this run says, so its clouds cannot be shown";
  if (!series) return null;
  if (MODELS.includes(layer) && !series.models.includes(layer))
    return layer === "corrected"
      ? "No correction network was trained for this run"
      : "This run does not hold the model";
  if (layer === "lump" && !series.lumps) return "No stiff lump was found in this run";
  if (layer === "landmarks" && !series.landmarks)
    return "This run does not say which landmarks were touched";
  return null;
}

export const quantityUnavailableReason = (quantity) =>
  state().series && state().series.limits[quantity] === null ? state().series.inside : null;

/** Draw one model coloured and in front, the others as lines; "plain" colours none. */
export function colourBy(colour) {
  const layers =
    colour === "plain" || state().layers.includes(colour)
      ? state().layers
      : [...state().layers, colour];
  const looks = Object.fromEntries(
    Object.entries(state().looks).map(([layer, { opacity: kept }]) => [
      layer,
      kept ? { opacity: kept } : {},
    ]),
  );
  set({ colour, layers: inDrawOrder(layers), looks });
}

export const inDrawOrder = (layers) =>
  Object.keys(LAYERS).filter((layer) => layers.includes(layer));

export function toggleLayer(layer) {
  const { layers } = state();
  set({
    layers: inDrawOrder(
      layers.includes(layer) ? layers.filter((other) => other !== layer) : [...layers, layer],
    ),
  });
}

/** All that the server needs to draw. */
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
  const held = quantityUnavailableReason(quantity) ? "error" : quantity;
  const range = ranges[held] ?? "robust";
  return {
    run,
    sequence,
    frame,
    layers: inDrawOrder(layers),
    colour,
    quantity: held,
    scale: range === "fixed" ? "fixed" : "robust",
    limit: range === "manual" ? (limits[held] ?? null) : null,
    crop,
    side_by_side: aside,
    section: section?.on ? { axis: section.axis, at: section.at, flip: section.flip } : null,
    looks: Object.fromEntries(Object.entries(looks).filter(([layer]) => layer in LAYERS)),
  };
}
