// The parameters that a sweep's form offers for a dataset, their ranges, and the fields of those
// that are held while others of the same effect are swept.
import { get } from "./api.js";
import { element } from "./dom.js";
import { capitalise, readableName, UNITS } from "./format.js";

/** @import { Effect, Parameter, SweepBounds } from "./types.js" */

/** @typedef {Parameter & { key: string, label: string, impossible: string }} SweepableParameter */

const SHOWN_UNITS = ["m", "Pa", "s", "rad"]; // SI units that the form converts
/** @type {Effect[]} */
let effects = [];
/** @type {string | null} */
let known = null; // the dataset that `effects` are of; empty for none
let wanted = ""; // the dataset that was asked for last

/**
 * Load the catalogue of effects as it is for a dataset, or for none.
 * @param {string} [dataset]
 */
export async function loadEffects(dataset = "") {
  if (known === dataset || (known !== null && !dataset)) {
    wanted = known;
    return;
  }
  wanted = dataset;
  const found = await get(dataset ? `/effects?dataset=${encodeURIComponent(dataset)}` : "/effects");
  if (wanted === dataset) [effects, known] = [found, dataset];
}

/**
 * Return the numeric parameters with bounds, with the names that the API and the form use.
 * @returns {SweepableParameter[]}
 */
export const sweepableParameters = () =>
  effects
    .filter((effect) => effect.by_hand)
    .flatMap((effect) =>
      effect.parameters
        .filter(({ choices, low, high }) => !choices.length && low !== null && high !== null)
        .map((item) => {
          const key = `${effect.name}.${item.name}`;
          return { ...item, key, label: parameterLabel(key), impossible: effect.impossible ?? "" };
        }),
    );

/**
 * @param {string} name
 * @returns {SweepableParameter | undefined}
 */
export const parameterOf = (name) => sweepableParameters().find(({ key }) => key === name);

/**
 * Return a parameter as words: its effect, and its own name where the effect has several.
 * @param {string} key effect and parameter with a dot between
 * @returns {string}
 */
export function parameterLabel(key) {
  const [cause, name] = key.split(".");
  const several = effects.find((effect) => effect.name === cause)?.parameters.length !== 1;
  const words = capitalise(readableName(cause));
  return several ? `${words}: ${readableName(name)}` : words;
}

/**
 * Return the factor from SI units to the unit of the form, and that unit.
 * @param {string} name
 * @returns {[number, string]}
 */
export const unitOf = (name) => shownUnit(parameterOf(name)?.unit ?? "");

/**
 * @param {string} unit
 * @returns {[number, string]}
 */
const shownUnit = (unit) =>
  SHOWN_UNITS.includes(unit) ? UNITS[unit] : [1, unit === "1" ? "" : unit];

/**
 * Return a parameter with the range of a sweep: what makes sense in the phantom, or its bounds.
 * @param {SweepableParameter} item
 * @returns {SweepBounds}
 */
export const wholeRange = ({ key, low, high, span }) => ({
  name: key,
  low: Math.max(low ?? 0, span?.[0] ?? -Infinity),
  high: Math.min(high ?? 0, span?.[1] ?? Infinity),
});

/**
 * Return the parameters of the swept effects that are not swept themselves, with their values.
 * @param {SweepBounds[]} axes
 * @param {Record<string, number | string>} held values that were set by hand [SI]
 * @returns {Record<string, number | string>}
 */
export function heldValues(axes, held) {
  const swept = axes.map(({ name }) => name);
  const causes = new Set(swept.map((name) => name.split(".")[0]));
  /** @type {Record<string, number | string>} */
  const values = {};
  for (const { name: cause, parameters } of effects)
    for (const { name, begin } of causes.has(cause) ? parameters : []) {
      const key = `${cause}.${name}`;
      const value = held[key] ?? begin;
      if (!swept.includes(key) && value !== null && value !== undefined) values[key] = value;
    }
  return values;
}

/**
 * Create the fields of the held parameters; nothing where there are none.
 * @param {SweepBounds[]} axes
 * @param {Record<string, number | string>} held values [SI] that the fields change
 * @returns {HTMLElement[]}
 */
export function heldFields(axes, held) {
  const names = Object.entries(heldValues(axes, held));
  if (!names.length) return [];
  return [
    element("h2", {}, "Held at"),
    element(
      "div",
      { class: "pair sweep-held" },
      names.map(([key, value]) => heldField(key, value, held)),
    ),
  ];
}

/**
 * @param {string} key
 * @param {number | string} value [SI]
 * @param {Record<string, number | string>} held
 * @returns {HTMLElement}
 */
function heldField(key, value, held) {
  const [cause, name] = key.split(".");
  const item = effects
    .find((effect) => effect.name === cause)
    ?.parameters.find((one) => one.name === name);
  const label = parameterLabel(key);
  if (item?.choices.length)
    return element(
      "label",
      {},
      label,
      element(
        "select",
        {
          "aria-label": `Held: ${key}`,
          onchange: (event) => {
            held[key] = event.target.value;
          },
        },
        item.choices.map((word) =>
          element("option", { value: word, selected: word === value }, word),
        ),
      ),
    );
  const [factor, unit] = shownUnit(item?.unit ?? "");
  return element(
    "label",
    {},
    `${label}${unit ? `, ${unit}` : ""}`,
    element("input", {
      type: "number",
      step: "any",
      required: true,
      value: +(Number(value) * factor).toPrecision(5),
      "aria-label": `Held: ${key}`,
      onchange: (event) => {
        if (event.target.value !== "") held[key] = +event.target.value / factor;
      },
    }),
  );
}
