// Use of the server's disk by results and caches, and a button that deletes the caches.
import { get, post, toast } from "./api.js";
import { element, fill } from "./dom.js";

/** @import { DiskUsage } from "./types.js" */

/**
 * @param {number} bytes
 * @returns {string}
 */
const size = (bytes) =>
  bytes >= 2 ** 30
    ? `${(bytes / 2 ** 30).toFixed(1)} GB`
    : `${(bytes / 2 ** 20).toFixed(bytes < 2 ** 20 ? 2 : 0)} MB`;

/**
 * Create the line with the disk usage; it asks the server each time it is created.
 * @returns {HTMLElement}
 */
export function diskUsageLine() {
  const box = element("p", { class: "disk muted", id: "disk" });
  /**
   * @param {DiskUsage} usage
   * @returns {void}
   */
  const show = ({ used, caches, limit }) => {
    const part = caches ? `${size(caches)} of it caches. ` : "no caches.";
    fill(
      box,
      `${size(used)} of ${size(limit)} on the disk, ${part}`,
      caches
        ? element(
            "button",
            {
              class: "link",
              type: "button",
              title: "They can be worked out again",
              onclick: () => post("/disk/empty").then(show).catch(toast),
            },
            "Drop the caches",
          )
        : null,
    );
  };
  get("/disk")
    .then(show)
    .catch(() => {});
  return box;
}
