// The right panel for a dataset: what it holds, whether its files are in order, and buttons for
// jobs on it.
import { get, post, toast, toError } from "./api.js";
import { byId, element, fill } from "./dom.js";
import { capitalise, formatMm } from "./format.js";
import { lookAtDataset } from "./import-panel.js";
import { openPanel } from "./panels.js";
import { cameraSelect, openRegistration } from "./register.js";

/** @import { DatasetSummary, ServerError } from "./types.js" */

/**
 * Check a dataset and show it.
 * @param {string} name
 * @param {(dataset: string, registration: string | null) => Promise<void>} diagnose
 * @param {string[]} [said] warnings of the import that made it just before
 */
export async function showDataset(name, diagnose, said = []) {
  const panel = byId("panel");
  openPanel("report");
  fill(
    panel,
    element("div", { class: "eyebrow" }, "Dataset"),
    element("h1", { class: "verdict" }, name),
    element("p", { class: "gain-note" }, "Reading every file …"),
  );
  /** @type {DatasetSummary} */
  let summary;
  try {
    summary = await get(`/datasets/${encodeURIComponent(name)}/check`);
  } catch (problem) {
    fill(
      panel,
      element("div", { class: "eyebrow" }, "Dataset"),
      element("h1", { class: "verdict" }, name),
      errorCard(toError(problem)),
    );
    return;
  }
  const camera = await cameraSelect(name);
  const start = element(
    "button",
    {
      class: "button strong",
      type: "button",
      onclick: async () => {
        start.disabled = true;
        start.textContent = "Started: see the jobs on the left";
        await diagnose(name, camera.value || null).catch(() => {
          start.disabled = false;
          start.textContent = "Diagnose";
        });
      },
    },
    "Diagnose",
  );
  const size = summary.size.map((edge) => formatMm(edge, false)).join(" × ");
  fill(
    panel,
    element("div", { class: "eyebrow" }, "Dataset"),
    element("h1", { class: "verdict" }, name),
    element("p", { class: "gain-note" }, "Every file was read and is in order."),
    element(
      "div",
      { class: "actions" },
      start,
      summary.has_rest
        ? element(
            "button",
            { class: "button", type: "button", onclick: () => openRegistration(name) },
            "Register by hand",
          )
        : null,
      summary.has_rest
        ? jobButton("Register automatically", "Keeps the automatic registration under a name", () =>
            post(`/datasets/${encodeURIComponent(name)}/registrations/automatic`),
          )
        : null,
      element(
        "button",
        {
          class: "button",
          type: "button",
          title: "Clouds, tool and forces over time, before any job",
          onclick: () => lookAtDataset(name),
        },
        "Look",
      ),
      jobButton("Replay", "All sequences as the setup is stated, seen like a diagnosis", () =>
        post("/replays", { dataset: name, registration: camera.value || null }),
      ),
    ),
    camera.hidden ? null : element("label", { class: "register-dataset" }, "Camera", camera),
    noteSection("Said by the import", said),
    noteSection("Doubtful", summary.warnings),
    noteSection("Missing for some causes", summary.lacks),
    element(
      "section",
      {},
      element("h2", {}, "Setup as stated"),
      element(
        "table",
        {},
        element(
          "tbody",
          {},
          fact("Name", summary.name),
          fact("Phantom", `${size} mm`),
          fact("Mass", `${(summary.mass * 1e3).toFixed(1)} g`),
          fact("Tool radius", formatMm(summary.tool_radius)),
          fact("Touches", summary.touches),
          fact("Rest cloud", summary.has_rest ? "yes" : "no"),
        ),
      ),
    ),
    element(
      "section",
      {},
      element("h2", {}, "Sequences"),
      element(
        "table",
        {},
        element(
          "tbody",
          {},
          summary.sequences.map(({ name: sequence, clouds, split }) =>
            element(
              "tr",
              {},
              element("th", {}, sequence),
              element("td", {}, split ?? "no split"),
              element("td", { class: "number" }, `${clouds} clouds`),
            ),
          ),
        ),
      ),
    ),
  );
}

/**
 * Create a button that starts a job.
 * @param {string} label
 * @param {string} title
 * @param {() => Promise<unknown>} request
 * @returns {HTMLElement}
 */
function jobButton(label, title, request) {
  const button = element(
    "button",
    {
      class: "button",
      type: "button",
      title,
      onclick: async () => {
        button.disabled = true;
        try {
          await request();
          button.textContent = "Started";
        } catch (problem) {
          toast(problem);
          button.disabled = false;
        }
      },
    },
    label,
  );
  return button;
}

/**
 * @param {string} label
 * @param {string | number} value
 * @returns {HTMLElement}
 */
const fact = (label, value) =>
  element("tr", {}, element("th", {}, label), element("td", { class: "number" }, String(value)));

/**
 * @param {string} title
 * @param {string[]} sentences
 * @returns {HTMLElement | null}
 */
const noteSection = (title, sentences) =>
  sentences.length
    ? element(
        "section",
        {},
        element("h2", {}, title),
        sentences.map((text) => element("div", { class: "note-card" }, capitalise(text))),
      )
    : null;

/**
 * @param {ServerError} problem
 * @returns {HTMLElement}
 */
const errorCard = ({ message, where }) =>
  element(
    "div",
    { class: "note-card bad" },
    element("strong", {}, "This dataset is not in order"),
    message,
    Object.keys(where ?? {}).length
      ? element(
          "div",
          { class: "where" },
          Object.entries(where ?? {})
            .map(([key, value]) => `${key}: ${value}`)
            .join("  "),
        )
      : null,
  );
