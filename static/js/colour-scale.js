// The banded colour scale with its numbers, the same in the scene's legend and under the patterns.
import { element } from "./dom.js";

export const rgbCss = (rgb) => `rgb(${rgb.join(" ")})`;

/** Of errors from -limit to limit [m], in mm. */
export const scaleBar = (bands, limit) => bandsWithTicks(bands, -limit * 1e3, limit * 1e3);

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

/** A scale upright between two numbers, the higher above. */
export function verticalScaleBar(bands, low, high) {
  const tower = bandsWithTicks([...bands].reverse(), low, high);
  const ticks = tower.querySelector(".ticks");
  ticks.replaceChildren(...[...ticks.children].reverse());
  tower.className = "tower";
  return tower;
}

export function bandIndex(value, limit, count) {
  return Math.min(count - 1, Math.max(0, Math.floor(((value / limit + 1) * count) / 2)));
}
