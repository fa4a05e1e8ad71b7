// The left rail: diagnoses, the sequences of the open one, datasets.
import { get, post, toast } from "./api.js";
import { openImportDialog, importDroppedFiles } from "./import-dialog.js";
import { showDataset } from "./dataset-panel.js";
import { element, fill } from "./dom.js";
import { formatMm, formatDateTime, readableName } from "./format.js";
import { onJobsDone, addResultOpener, startJobs } from "./jobs.js";
import { openedPanel } from "./panels.js";
import { openRegistration } from "./register.js";
import { subscribe, set, state } from "./store.js";

const TAGS = { train: "fit", validation: "val", test: "test" };
let requestedDiagnosis = null;
let openRun = null;

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
    // Who has gone elsewhere meanwhile finds it among the jobs and the diagnoses.
    if (openedPanel() === "report" && done.some(({ id }) => id === requestedDiagnosis))
      openRun(requestedDiagnosis);
  });
  addResultOpener("registration", "See the registration", (_, __, { dataset }) =>
    openRegistration(dataset),
  );
  document.getElementById("import").addEventListener("click", () => openImportDialog());
  importDroppedFiles();
  startJobs();
  const [datasets] = await Promise.all([refreshDatasets(), refreshRuns()]);
  return datasets.length;
}

async function refreshDatasets() {
  const { datasets, folder } = await get("/datasets");
  fill(
    "datasets",
    datasets.length
      ? datasets.map((name) =>
          element(
            "button",
            { class: "row", type: "button", onclick: () => showDataset(name, diagnose) },
            element("span", { class: "name" }, name),
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

/** A dataset in the right panel. */
export const openDataset = (name) => showDataset(name, diagnose);

let runs = [];

async function refreshRuns() {
  runs = await get("/runs");
  drawRuns();
  return runs;
}

export const runToOpen = (wanted) => (runs.find(({ id }) => id === wanted) ?? runs[0])?.id ?? null;

function drawRuns() {
  fill(
    "runs",
    runs.length
      ? runs.map(({ id, verdict, causes, created, dataset, folder }) =>
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
                `${verdict === "replay" ? "replay · " : ""}${folder ?? dataset} · ${formatDateTime(created)}`,
              ),
            ),
          ),
        )
      : element("p", { class: "empty" }, "None yet. Choose a dataset below and start one."),
  );
}

function drawSequences() {
  const { heading, sequence } = state();
  document.getElementById("sequences-section").hidden = !heading;
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
          title: `${entry.frames} frames, ${entry.seconds.toFixed(0)} s; error in the worst frame, raw → extended`,
          onclick: () => set({ sequence: entry.name, frame: 0, playing: false }),
        },
        element("span", { class: `tag ${entry.split ?? ""}` }, TAGS[entry.split] ?? "–"),
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

export async function diagnose(dataset, registration = null) {
  try {
    requestedDiagnosis = (await post("/diagnoses", { dataset, registration })).id;
  } catch (problem) {
    toast(problem);
    throw problem;
  }
}
