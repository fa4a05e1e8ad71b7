// The banded colour scale with its numbers, the same in the scene's legend and under the patterns.
import { element } from "./dom.js";

export const css = (rgb) => `rgb(${rgb.join(" ")})`;

export function scaleBar(bands, limit) {
  const ticks = [-1, -0.5, 0, 0.5, 1].map((part) => {
    const value = part * limit * 1e3;
    return (value > 0 ? "+" : "") + (part ? +value.toPrecision(3) : 0).toString().replace("-", "−");
  });
  return element("div", {},
    element("div", { class: "scale" }, bands.map((rgb) => element("i", { style: { background: css(rgb) } }))),
    element("div", { class: "ticks" }, ticks.map((text) => element("span", {}, text))));
}

/** The same scale upright, positive above. */
export function scaleTower(bands, limit) {
  const bar = scaleBar([...bands].reverse(), limit);
  const ticks = bar.querySelector(".ticks");
  ticks.replaceChildren(...[...ticks.children].reverse());
  bar.className = "tower";
  return bar;
}

export function bandOf(value, limit, count) {
  return Math.min(count - 1, Math.max(0, Math.floor((value / limit + 1) * count / 2)));
}
