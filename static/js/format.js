// Numbers, names and times as text.
/** @import { Estimate } from "./types.js" */

/**
 * Factor from an SI unit to the unit that is shown, and that unit.
 * @type {Record<string, [number, string]>}
 */
export const UNITS = {
  m: [1e3, "mm"],
  Pa: [1e-3, "kPa"],
  s: [1e3, "ms"],
  rad: [180 / Math.PI, "°"],
  "1/m": [1, "/m"],
  1: [1, ""],
};

/**
 * Return a name of the API as words: "tool_radius" becomes "tool radius".
 * @param {string} name
 * @returns {string}
 */
export const readableName = (name) => NAMES[name] ?? name.replaceAll("_", " ");

/**
 * @param {string} text
 * @returns {string}
 */
export const capitalise = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** @type {Record<string, string>} */
const NAMES = {
  poisson_ratio: "Poisson’s ratio",
  young_modulus: "Young’s modulus",
  nu: "ν",
  specific_weight_over_stiffness: "ρg/E",
};

/**
 * Format a length in metres as millimetres: two decimals below 10 mm, else one.
 * @param {number | null | undefined} metres
 * @param {boolean} [unit]
 * @returns {string}
 */
export function formatMm(metres, unit = true) {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return "–";
  const value = metres * 1e3;
  return value.toFixed(Math.abs(value) < 9.995 ? 2 : 1) + (unit ? " mm" : "");
}

/**
 * Format a parameter and its interval, with as many decimals as the interval's width deserves; a
 * value far below that width adds none.
 * @param {Estimate} estimate
 * @returns {{ value: string, unit: string, interval: string }}
 */
export function formatParameter({ value, unit, low, high }) {
  if (typeof value !== "number") return { value: String(value), unit: "", interval: "" };
  const [factor, shown] = UNITS[unit] ?? [1, unit];
  const open = typeof low !== "number" || typeof high !== "number";
  const width = open ? Math.abs(value * factor) / 5 : Math.abs(high - low) * factor;
  const size = Math.abs(value * factor) > width / 100 ? Math.abs(value * factor) : 0;
  const places = Math.min(
    4,
    Math.max(
      0,
      1 - Math.floor(Math.log10(width || Infinity)),
      1 - Math.floor(Math.log10(size || Infinity)),
    ),
  );
  /**
   * @param {number} number
   * @returns {string}
   */
  const text = (number) =>
    (number * factor)
      .toFixed(places)
      .replace(/^-(?=[0.]*$)/, "")
      .replace("-", "−");
  return { value: text(value), unit: shown, interval: open ? "" : `${text(low)} to ${text(high)}` };
}

/**
 * Format a fraction of 1 as a percentage.
 * @param {number | null | undefined} fraction
 * @param {number} [digits]
 * @returns {string}
 */
export function formatPercent(fraction, digits = 0) {
  if (typeof fraction !== "number") return "–";
  if (fraction > 0 && fraction < 0.005 && !digits) return "<1 %";
  return `${(100 * fraction).toFixed(digits).replace("-", "−")} %`;
}

/**
 * @param {number} seconds
 * @returns {string}
 */
export function formatDuration(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  return whole < 60
    ? `${whole} s`
    : `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
}

/**
 * @param {number} epoch seconds since 1970
 * @returns {string}
 */
export function formatDateTime(epoch) {
  return new Date(epoch * 1e3).toLocaleString(undefined, {
    day: "numeric",
    month: "short",
    hour: "2-digit",
    minute: "2-digit",
  });
}
