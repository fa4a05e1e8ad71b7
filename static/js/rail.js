// The left rail: jobs with progress, diagnoses, the sequences of the open one, datasets.
import { get, post, toast } from "./api.js";
import { showDataset } from "./dataset.js";
import { element, fill, icon } from "./dom.js";
import { duration, mm, when, words } from "./format.js";
import { on, set, state } from "./store.js";

const TAGS = { train: "fit", validation: "val", test: "test" };
const JUST_ENDED = 15 * 60;
let jobs = [];
let asked = null;
let openRun = null;

export async function start(open) {
  openRun = open;
  on(["run", "sequence", "heading"], drawSequences);
  on(["run"], () => drawRuns());
  watchJobs();
  const [{ datasets, folder }] = await Promise.all([get("/datasets"), refreshRuns()]);
  fill("datasets", datasets.length ? datasets.map((name) => element("button", { class: "row", type: "button", onclick: () => showDataset(name, diagnose) }, element("span", { class: "name" }, name)))
    : element("p", { class: "empty" }, `None in ${folder}. Put a dataset folder there and reload.`));
  return datasets.length;
}

let runs = [];

async function refreshRuns() { runs = await get("/runs"); drawRuns(); return runs; }

export const newestRun = (wanted) => (runs.find(({ id }) => id === wanted) ?? runs[0])?.id ?? null;

function drawRuns() {
  fill("runs", runs.length ? runs.map(({ id, verdict, causes, created, dataset, folder }) => element("button", {
    class: "row", type: "button", "aria-current": String(id === state().run), "data-run": id, title: id, onclick: () => openRun(id),
  }, element("span", { class: "stack" }, element("span", { class: "name" }, causes.length ? causes.map(words).join(" + ") : verdict === "none" ? "nothing wrong" : verdict),
    element("span", { class: "sub" }, `${folder ?? dataset} · ${when(created)}`))))
    : element("p", { class: "empty" }, "None yet. Choose a dataset below and start one."));
}

function drawSequences() {
  const { heading, sequence } = state();
  document.getElementById("sequences-section").hidden = !heading;
  if (!heading) return;
  fill("sequences", heading.sequences.map((entry) => element("button", {
    class: "row", type: "button", "aria-current": String(entry.name === sequence), "data-sequence": entry.name,
    title: `${entry.frames} frames, ${entry.seconds.toFixed(0)} s; error in the worst frame, raw → extended`, onclick: () => set({ sequence: entry.name, frame: 0, playing: false }),
  }, element("span", { class: `tag ${entry.split ?? ""}` }, TAGS[entry.split] ?? "–"), element("span", { class: "name" }, entry.name),
    element("span", { class: "value" }, `${mm(entry.distance_raw, false)} → ${mm(entry.distance_extended, false)}`))));
}

export async function diagnose(dataset) {
  try {
    asked = (await post("/diagnoses", { dataset })).id;
  } catch (problem) { toast(problem); throw problem; }
}

function watchJobs() {
  const events = new EventSource("/api/jobs/events");
  events.onmessage = async ({ data }) => {
    const before = new Map(jobs.map(({ id, state: was }) => [id, was]));
    jobs = JSON.parse(data);
    drawJobs();
    const finished = jobs.filter(({ id, state: now }) => now === "done" && before.has(id) && before.get(id) !== "done");
    if (!finished.length) return;
    await refreshRuns();
    if (finished.some(({ id }) => id === asked)) { openRun(asked); asked = null; }
  };
  setInterval(drawJobs, 1000);
}

function drawJobs() {
  const now = Date.now() / 1e3;
  const shown = jobs.filter(({ state: at, finished }) => ["queued", "running"].includes(at) || (at !== "done" && now - finished < JUST_ENDED)).slice(0, 6);
  fill("jobs", shown.length ? shown.map((job) => drawJob(job, now)) : element("p", { class: "empty" }, "Nothing is running."));
}

function drawJob({ id, dataset, kind, state: at, fraction, text, started, error }, now) {
  const active = at === "running" || at === "queued";
  const spent = started ? now - started : 0;
  const left = at === "running" && fraction > 0.03 ? `about ${duration(spent / fraction * (1 - fraction))} left` : at === "running" ? duration(spent) : "";
  return element("div", { class: "job", "data-job": id },
    element("div", { class: "head" }, element("span", { class: "name", title: id }, `${dataset ?? kind}`),
      element("span", { class: "value muted" }, active ? `${Math.round(100 * fraction)} %` : at),
      active ? element("button", { class: "icon-button", type: "button", title: "Cancel", onclick: () => post(`/jobs/${id}/cancel`).catch(toast) }, icon("close")) : null),
    active ? element("div", { class: "progress" }, element("i", { style: { width: `${100 * fraction}%` } })) : null,
    error ? element("div", { class: "sub bad" }, error.message) : element("div", { class: "sub" }, element("span", {}, text), element("span", {}, left)));
}
