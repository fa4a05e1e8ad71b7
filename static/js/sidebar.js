// The left sidebar: jobs, runs, the sequences of the open run, datasets.
import { get, post, toast } from "./api.js";
import { importDroppedFiles } from "./import-dialog.js";
import { lookAtDataset, takeFiles } from "./import-panel.js";
import { showDataset } from "./dataset-panel.js";
import { byId, element, fill } from "./dom.js";
import { formatMm, formatDateTime, readableName } from "./format.js";
import { onJobsDone, onResultDeleted, addResultOpener, startJobs } from "./jobs.js";
import { openedPanel, openPanel } from "./panels.js";
import { openRegistration } from "./register.js";
import { subscribe, set, state } from "./store.js";

/** @import { RunEntry } from "./types.js" */

/**
 * Labels of the splits.
 * @type {Record<string, string>}
 */
const TAGS = { train: "fit", validation: "val", test: "test" };
/** @type {string | null} */
let requestedDiagnosis = null; // the last diagnosis that was started here
/** @type {(id: string) => unknown} */
let openRun = () => undefined;

/**
 * Fill the sidebar and follow the jobs; `open` opens a run. Returns the number of datasets.
 * @param {(id: string) => unknown} open
 * @returns {Promise<number>}
 */
export async function start(open) {
  openRun = open;
  subscribe(["run", "sequence", "heading"], drawSequences);
  subscribe(["run"], () => drawRuns());
  addResultOpener("run", "Open the report", open);
  addResultOpener("dataset", "Open the dataset", (name) => openDataset(name));
  onJobsDone(async (done) => {
    await Promise.all([
      refreshRuns(),
      done.some(({ result }) => result?.dataset) ? refreshDatasets() : null,
    ]);
    // Opened only while the report is in front, so that nobody is taken away from another panel.
    const finished = done.find(({ id }) => id === requestedDiagnosis);
    if (finished && openedPanel() === "report") openRun(finished.id);
  });
  onResultDeleted(async (kind, name) => {
    if (kind !== "run") return;
    await refreshRuns();
    if (name !== state().run) return;
    if (runs.length) openRun(runs[0].id);
    else location.reload();
  });
  addResultOpener("registration", "See the registration", (_, __, { dataset }) =>
    openRegistration(dataset),
  );
  byId("import").addEventListener("click", () => openPanel("import"));
  importDroppedFiles(takeFiles, () => openedPanel() === "import");
  startJobs();
  const [datasets] = await Promise.all([refreshDatasets(), refreshRuns()]);
  return datasets.length;
}

/** @returns {Promise<string[]>} */
async function refreshDatasets() {
  /** @type {{ datasets: string[], folder: string }} */
  const { datasets, folder } = await get("/datasets");
  fill(
    "datasets",
    datasets.length
      ? datasets.map((name) =>
          element(
            "div",
            { class: "row-pair" },
            element(
              "button",
              { class: "row", type: "button", onclick: () => showDataset(name, diagnose) },
              element("span", { class: "name" }, name),
            ),
            element(
              "button",
              {
                class: "link",
                type: "button",
                title: `Look at the recordings of ${name}`,
                "aria-label": `Look at ${name}`,
                onclick: () => lookAtDataset(name),
              },
              "Look",
            ),
          ),
        )
      : element(
          "p",
          { class: "empty" },
          `None in ${folder}. Import one, or put its folder there and reload.`,
        ),
  );
  return datasets;
}

/**
 * Show a dataset in the right panel.
 * @param {string} name
 * @param {string[]} [said] warnings of the import that made it just before
 */
export const openDataset = (name, said = []) => showDataset(name, diagnose, said);

/** @type {RunEntry[]} */
let runs = [];

/**
 */
async function refreshRuns() {
  runs = await get("/runs");
  drawRuns();
  return runs;
}

/**
 * Return the id of a run if there is such a run, else that of the newest one.
 * @param {string | null} id
 * @returns {string | null}
 */
export const runToOpen = (id) => (runs.find((run) => run.id === id) ?? runs[0])?.id ?? null;

function drawRuns() {
  fill(
    "runs",
    runs.length
      ? runs.map(({ id, verdict, causes, created, dataset, folder, data_changed: changed }) =>
          element(
            "button",
            {
              class: "row",
              type: "button",
              "aria-current": String(id === state().run),
              "data-run": id,
              title: id,
              onclick: () => openRun(id),
            },
            element(
              "span",
              { class: "stack" },
              element(
                "span",
                { class: "name" },
                causes.length
                  ? causes.map(readableName).join(" + ")
                  : verdict === "none"
                    ? "nothing wrong"
                    : verdict === "replay"
                      ? "as stated"
                      : verdict,
              ),
              element(
                "span",
                { class: "sub" },
                [
                  changed ? "⚠ data changed" : "",
                  verdict === "replay" ? "replay" : "",
                  folder ?? dataset,
                  formatDateTime(created),
                ]
                  .filter(Boolean)
                  .join(" · "),
              ),
            ),
          ),
        )
      : element("p", { class: "empty" }, "None yet. Choose a dataset below and start one."),
  );
}

function drawSequences() {
  const { heading, sequence } = state();
  byId("sequences-section").hidden = !heading;
  if (!heading) return;
  fill(
    "sequences",
    heading.sequences.map((entry) =>
      element(
        "button",
        {
          class: "row",
          type: "button",
          "aria-current": String(entry.name === sequence),
          "data-sequence": entry.name,
          title:
            `${entry.frames} frames, ${entry.seconds.toFixed(0)} s; ` +
            "error in the worst frame, raw → extended",
          onclick: () => set({ sequence: entry.name, frame: 0, playing: false }),
        },
        element("span", { class: `tag ${entry.split ?? ""}` }, TAGS[entry.split ?? ""] ?? "–"),
        element("span", { class: "name" }, entry.name),
        element(
          "span",
          { class: "value" },
          `${formatMm(entry.distance_raw, false)} → ${formatMm(entry.distance_extended, false)}`,
        ),
      ),
    ),
  );
}

/**
 * Start the diagnosis of a dataset, with a kept registration or the automatic one.
 * @param {string} dataset
 * @param {string | null} [registration]
 */
async function diagnose(dataset, registration = null) {
  try {
    requestedDiagnosis = (await post("/diagnoses", { dataset, registration })).id;
  } catch (problem) {
    toast(problem);
    throw problem;
  }
}
