// Last step of an import: the name of the dataset, the job, and the progress of any job of the
// panel.
import { element } from "./dom.js";
import { formatDuration } from "./format.js";
import { needsForceFrame, takenStream } from "./import-setup.js";

/** @import { CutEditor, ImportActions, ImportView } from "./types.js" */

const NAME = "[A-Za-z0-9][A-Za-z0-9._\\-]*";

/**
 * @param {ImportView} view
 * @param {CutEditor | null} editor
 * @param {ImportActions} actions
 * @param {{ name: HTMLElement | null, other: HTMLElement | null }} problems
 * @returns {HTMLElement | null}
 */
export function finishSection(view, editor, actions, problems) {
  const { look, name, job, imported } = view;
  if (!look) return null;
  if (look.source.kind === "dataset")
    return element(
      "div",
      { class: "actions" },
      element(
        "button",
        {
          class: "button",
          type: "button",
          onclick: () => actions.openDataset(look.dataset ?? look.source.name),
        },
        "Open the dataset",
      ),
    );
  const why = obstacle(view, editor);
  const field = element("input", {
    name: "name",
    required: true,
    maxlength: 64,
    pattern: NAME,
    title: "Letters, digits, dot, dash, underscore",
    autocomplete: "off",
    value: name,
    "aria-label": "Name of the dataset",
    "data-key": "dataset-name",
    "aria-invalid": problems.name ? "true" : null,
    oninput: ({ target }) => {
      view.name = target.value;
    },
  });
  return element(
    "section",
    { class: "import-step", "aria-label": "Dataset" },
    element("h2", {}, "5  Dataset"),
    element(
      "form",
      {
        class: "import-path",
        onsubmit: (event) => {
          event.preventDefault();
          actions.startImport();
        },
      },
      element("label", {}, "Its name here", field),
      element(
        "button",
        {
          class: "button strong",
          type: "submit",
          "data-key": "import",
          disabled: job !== null || why !== null,
          "aria-describedby": why ? "import-obstacle" : null,
        },
        "Import",
      ),
    ),
    problems.name,
    job?.kind === "import" ? jobSection(view, actions) : null,
    why ? element("p", { class: "import-hint", id: "import-obstacle" }, why) : null,
    problems.other,
    imported
      ? element(
          "div",
          { class: "note-card good", role: "status" },
          element("strong", {}, `Imported as ${imported.dataset}`),
          element(
            "button",
            {
              class: "link",
              type: "button",
              onclick: () => actions.openDataset(imported.dataset),
            },
            "Open the dataset",
          ),
        )
      : null,
  );
}

/**
 * Return what is missing before an import; null where nothing is.
 * @param {ImportView} view
 * @param {CutEditor | null} editor
 * @returns {string | null}
 */
function obstacle(view, editor) {
  const { look } = view;
  if (!look) return null;
  if (!takenStream(view, "pose")) return "No stream is taken as the tool’s poses: step 2.";
  if (!look.setup_stated) return "State the setup first: step 3.";
  if (needsForceFrame(view)) return "State the axes of the forces first: above.";
  if (editor?.problems().length) return "A sequence has no valid name: step 4.";
  return null;
}

/**
 * Draw the progress of a job, with a button that cancels it; null without a job.
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @returns {HTMLElement | null}
 */
export function jobSection({ job }, actions) {
  if (!job) return null;
  const share = Math.round(100 * job.fraction);
  const waits = job.state === "queued";
  const label = job.kind === "import" ? "Importing" : "Looking at the recordings";
  return element(
    "section",
    { class: "import-job", "aria-label": label },
    element(
      "div",
      { class: "head" },
      element("b", {}, label),
      element("span", { class: "value" }, waits ? "waits for other jobs" : `${share} %`),
      element(
        "button",
        { class: "button small", type: "button", "data-key": "cancel", onclick: actions.cancelJob },
        "Cancel",
      ),
    ),
    element(
      "div",
      {
        class: "progress",
        role: "progressbar",
        "aria-label": label,
        "aria-valuemin": 0,
        "aria-valuemax": 100,
        "aria-valuenow": share,
      },
      element("i", { style: { width: `${share}%` } }),
    ),
    element(
      "p",
      { class: "import-hint" },
      job.text,
      job.remaining === null ? null : ` · about ${formatDuration(job.remaining)} left`,
    ),
  );
}
