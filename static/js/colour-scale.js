// The colour scale in bands with its numbers, used by the scene's legend and below the error
// maps.
import { element } from "./dom.js";

/** @import { Rgb } from "./types.js" */

/**
 * @param {Rgb} rgb
 * @returns {string}
 */
export const rgbCss = (rgb) => `rgb(${rgb.join(" ")})`;

/**
 * Create a scale of errors from -limit to limit [m], with numbers in mm.
 * @param {Rgb[]} bands
 * @param {number} limit
 * @returns {HTMLElement}
 */
export const scaleBar = (bands, limit) => bandsWithTicks(bands, -limit * 1e3, limit * 1e3);

/**
 * @param {Rgb[]} bands
 * @param {number} low
 * @param {number} high
 * @returns {HTMLElement}
 */
function bandsWithTicks(bands, low, high) {
  const ticks = [0, 0.25, 0.5, 0.75, 1].map((part) => {
    const value = low + (high - low) * part;
    const near = Math.abs(value) < 1e-9 * (high - low) ? 0 : value;
    return (near > 0 && low < 0 ? "+" : "") + (+near.toPrecision(3)).toString().replace("-", "−");
  });
  return element(
    "div",
    {},
    element(
      "div",
      { class: "scale" },
      bands.map((rgb) => element("i", { style: { background: rgbCss(rgb) } })),
    ),
    element(
      "div",
      { class: "ticks" },
      ticks.map((text) => element("span", {}, text)),
    ),
  );
}

/**
 * Create a vertical scale between two numbers, the higher one on top.
 * @param {Rgb[]} bands
 * @param {number} low
 * @param {number} high
 * @returns {HTMLElement}
 */
export function verticalScaleBar(bands, low, high) {
  const tower = bandsWithTicks([...bands].reverse(), low, high);
  const ticks = tower.querySelector(".ticks");
  ticks?.replaceChildren(...[...ticks.children].reverse());
  tower.className = "tower";
  return tower;
}

/**
 * Return the band of a value on a scale from -limit to limit with `count` bands.
 * @param {number} value
 * @param {number} limit
 * @param {number} count
 * @returns {number}
 */
export function bandIndex(value, limit, count) {
  return Math.min(count - 1, Math.max(0, Math.floor(((value / limit + 1) * count) / 2)));
}
