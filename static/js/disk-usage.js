// What results and caches take on the server's disk, and a way to drop the caches.
import { get, post, toast } from "./api.js";
import { element, fill } from "./dom.js";

const size = (bytes) =>
  bytes >= 2 ** 30
    ? `${(bytes / 2 ** 30).toFixed(1)} GB`
    : `${(bytes / 2 ** 20).toFixed(bytes < 2 ** 20 ? 2 : 0)} MB`;

/** A line that says it; asked anew whenever it is made. */
export function diskUsageLine() {
  const box = element("p", { class: "disk muted", id: "disk" });
  const show = ({ used, caches, limit }) =>
    fill(
      box,
      `${size(used)} of ${size(limit)} on the disk, ${caches ? `${size(caches)} of it caches. ` : "no caches."}`,
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
  get("/disk")
    .then(show)
    .catch(() => {});
  return box;
}
