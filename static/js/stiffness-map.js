// The free map of the stiffness: where the body is stiffer or softer than usual, and its picture.
import { element } from "./dom.js";

/**
 * @import { Report, RunHeading } from "./types.js"
 */

/**
 * List what the map says, with its picture where it shows more than noise; empty without a map.
 * @param {RunHeading} heading
 * @param {Report} report
 * @returns {HTMLElement[]}
 */
export function stiffnessMap({ id, stiffness }, { stiffness_map: found }) {
  if (!found) return [];
  const rows = (stiffness ?? []).map((text) => element("p", { class: "gain-note" }, text));
  if (found.structured)
    rows.push(
      element("img", {
        src: `/api/runs/${encodeURIComponent(id)}/pictures/stiffness.png`,
        alt: "Stiffness below the surface from three sides; grey where nothing is told",
        class: "report-picture",
      }),
    );
  return rows;
}
