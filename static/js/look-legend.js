// The legend of a look's scene: why points are kept or dropped, how many, and which are hidden.
import { element, fill } from "./dom.js";
import { keepFocus } from "./keep-focus.js";

/** @import { CloudReason } from "./types.js" */

/**
 * Draw the reasons with the numbers of points of the cloud that is shown; none hides the legend.
 * @param {HTMLElement} legend
 * @param {CloudReason[]} reasons
 * @param {Record<string, number>} counts
 * @param {Set<string>} hidden
 * @param {(name: string) => void} toggle
 */
export function drawReasons(legend, reasons, counts, hidden, toggle) {
  legend.hidden = !reasons.length;
  keepFocus(legend, "data-reason", () =>
    fill(
      legend,
      element("div", { class: "title" }, "Points of this cloud"),
      element(
        "ul",
        { "aria-label": "Points of this cloud by reason" },
        reasons
          .filter(({ name }) => counts[name] || name === "kept")
          .map(({ name, label, colour }) =>
            element(
              "li",
              {},
              element(
                "button",
                {
                  type: "button",
                  "aria-pressed": String(!hidden.has(name)),
                  "data-reason": name,
                  title: hidden.has(name) ? `Show: ${label}` : `Hide: ${label}`,
                  onclick: () => toggle(name),
                },
                element("i", { class: "swatch", style: { background: cssColour(colour) } }),
                element("span", {}, label),
                element("b", {}, String(counts[name] ?? 0)),
              ),
            ),
          ),
      ),
    ),
  );
}

/**
 * @param {string | number[]} colour
 * @returns {string}
 */
const cssColour = (colour) =>
  typeof colour === "string" ? colour : `rgb(${colour.map((one) => Math.round(one)).join(" ")})`;
