// Entry point of the page: starts its modules, and opens runs and sequences.
import { get, toast } from "./api.js";
import * as correction from "./correction-panel.js";
import { byId, fill, icon } from "./dom.js";
import { startHelp } from "./help.js";
import * as live from "./live-panel.js";
import { openPanel } from "./panels.js";
import * as sidebar from "./sidebar.js";
import { showProblem, showReport, showWelcome } from "./report-panel.js";
import * as scene from "./scene.js";
import { subscribe, set, state } from "./store.js";
import { startRegister } from "./register.js";
import { startSweeps } from "./sweep-panel.js";
import * as timeline from "./timeline.js";
import * as whatif from "./whatif-panel.js";

/**
 * @import {
 *   FrameValues, Patterns, Report, RunHeading, SequenceEntry, Series
 * } from "./types.js"
 */

/**
 * Icons of the theme button.
 * @type {Record<string, string>}
 */
const THEMES = { light: "moon", dark: "sun" };

/** Set the button up that switches between light and dark. */
function startTheme() {
  const draw = () => fill("theme", icon(THEMES[state().theme]));
  byId("theme").addEventListener("click", () => {
    const theme = state().theme === "dark" ? "light" : "dark";
    localStorage.setItem("palpate.theme", theme);
    document.documentElement.dataset.theme = theme;
    set({ theme });
  });
  subscribe(["theme"], draw);
  draw();
}

/** Show the log-out button to those who logged in with a token. */
function startLogOut() {
  const form = byId("log-out");
  form.hidden = !/(^|; )palpate_inside=1/.test(document.cookie);
  if (form.firstElementChild) fill(form.firstElementChild, icon("leave"));
}

/**
 * Show a run's report and its sequence.
 * @param {string} id
 */
async function openRun(id) {
  set({ playing: false });
  try {
    /** @type {[RunHeading, Report, Patterns | null]} */
    const [heading, report, patterns] = await Promise.all([
      get(`/runs/${id}`),
      get(`/runs/${id}/report`),
      get(`/runs/${id}/patterns`).catch(() => null),
    ]);
    const names = heading.sequences.map(({ name }) => name);
    const sequence =
      state().run === id && names.includes(state().sequence ?? "")
        ? state().sequence
        : preferredSequence(heading.sequences);
    showReport(heading, report, patterns, state().palette);
    if (state().run !== id || state().sequence !== sequence)
      set({ frame: 0, series: null, loop: null });
    set({ run: id, sequence, heading, report });
    await openSequence();
  } catch (problem) {
    showProblem(problem);
  }
}

/**
 * Return the test sequence whose error the extended model reduces most; without test sequences,
 * of all.
 * @param {SequenceEntry[]} sequences
 * @returns {string | null}
 */
function preferredSequence(sequences) {
  const tested = sequences.filter(({ split }) => split === "test");
  /**
   * @param {SequenceEntry} entry
   * @returns {number}
   */
  const gain = ({ distance_raw: raw, distance_extended: extended }) => (raw ?? 0) - (extended ?? 0);
  return (
    [...(tested.length ? tested : sequences)].sort((a, b) => gain(b) - gain(a))[0]?.name ?? null
  );
}

/** Load the series of the chosen sequence, and on a new one go to the frame that shows most. */
async function openSequence() {
  const { run, sequence } = state();
  if (!run || !sequence) return;
  /** @type {Series} */
  const series = await get(`/runs/${run}/sequences/${encodeURIComponent(sequence)}`);
  if (state().run !== run || state().sequence !== sequence) return;
  const fresh = state().series?.name !== sequence;
  set({ series });
  if (fresh && state().frame === 0) timeline.go(firstFrameShown(series));
}

/**
 * Return the frame whose error the extended model reduces most, else the one with the largest raw
 * error.
 * @param {Series} series
 * @returns {number}
 */
function firstFrameShown({ distance_raw: raw, distance_extended: extended }) {
  const gain = raw.map((error, frame) => (error ?? 0) - (extended?.[frame] ?? error ?? 0));
  return indexOfHighest(gain.some((value) => value > 0) ? gain : raw);
}

/**
 * @param {FrameValues} values
 * @returns {number}
 */
const indexOfHighest = (values) =>
  values.reduce(
    (/** @type {number} */ best, value, index) =>
      (value ?? 0) > (values[best] ?? 0) ? index : best,
    0,
  );

/** Start everything, and open the run of the address, the last one or the newest. */
async function start() {
  startTheme();
  startLogOut();
  const palette = await get("/palette");
  set({ palette });
  timeline.start();
  startSweeps();
  correction.start(() => openSequence().catch(toast));
  startRegister(sidebar.openDataset);
  startHelp();
  scene.start();
  whatif.start();
  live.start();
  subscribe(["sequence"], () => {
    set({ series: null, frame: 0, loop: null });
    openSequence().catch(toast);
  });
  // A run that a person chooses brings the report to the front; one that merely loads does not.
  const datasets = await sidebar.start((id) => {
    openPanel("report");
    return openRun(id);
  });
  const id = new URLSearchParams(location.search).get("run") ?? state().run;
  const run = sidebar.runToOpen(id);
  if (run) await openRun(run);
  else {
    set({ run: null, sequence: null });
    showWelcome(datasets > 0);
  }
}

start().catch(toast);
