// Use of the server's disk: a button that deletes the caches, and the largest results to delete.
import { get, post, remove, toast } from "./api.js";
import { element, fill } from "./dom.js";
import { formatDateTime } from "./format.js";

/** @import { DiskUsage, StoredResult } from "./types.js" */

/**
 * @param {number} bytes
 * @returns {string}
 */
const size = (bytes) =>
  bytes >= 2 ** 30
    ? `${(bytes / 2 ** 30).toFixed(1)} GB`
    : `${(bytes / 2 ** 20).toFixed(bytes < 2 ** 20 ? 2 : 0)} MB`;

/**
 * Create the part with the disk usage; it asks the server each time it is created.
 * @param {(kind: string, name: string) => void} deleted is told which result is gone
 * @returns {HTMLElement}
 */
export function diskUsage(deleted) {
  const box = element("div", { class: "disk muted", id: "disk" });
  /**
   * @param {DiskUsage} usage
   * @returns {void}
   */
  const show = ({ used, caches, limit, largest }) => {
    const part = caches ? `${size(caches)} of it caches. ` : "no caches.";
    const full = used - caches > limit;
    fill(
      box,
      element(
        "p",
        full ? { class: "warning", role: "alert" } : {},
        full
          ? `The results take ${size(used - caches)} of ${size(limit)}: nothing new begins. ` +
              "Delete some of them. "
          : `${size(used)} of ${size(limit)} on the disk, ${part}`,
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
      ),
      largest.length
        ? element(
            "details",
            { open: full },
            element("summary", {}, "The largest results"),
            largest.map((one) => row(one, show)),
          )
        : null,
    );
  };
  /**
   * @param {StoredResult} result
   * @param {(usage: DiskUsage) => void} again
   * @returns {HTMLElement}
   */
  const row = ({ kind, name, bytes, created }, again) =>
    element(
      "div",
      { class: "stored", "data-stored": name },
      element(
        "span",
        { title: `${kind} ${name}, ${formatDateTime(created)}` },
        `${kind} ${name} · ${size(bytes)}`,
      ),
      element(
        "button",
        {
          class: "link",
          type: "button",
          "aria-label": `Delete ${kind} ${name}`,
          onclick: () => {
            if (!window.confirm(`Delete ${kind} ${name} for good? It cannot be brought back.`))
              return;
            remove(`/disk/${kind}/${encodeURIComponent(name)}`)
              .then(() => {
                deleted(kind, name);
                return get("/disk");
              })
              .then(again)
              .catch(toast);
          },
        },
        "Delete",
      ),
    );
  get("/disk")
    .then(show)
    .catch(() => {});
  return box;
}
