// Starts the parts and follows what is chosen.
import { get, toast } from "./api.js";
import * as correction from "./correction-panel.js";
import { fill, icon } from "./dom.js";
import { startHelp } from "./help.js";
import * as live from "./live-panel.js";
import { openPanel } from "./panels.js";
import * as rail from "./sidebar.js";
import { showProblem, showReport, showWelcome } from "./report-panel.js";
import * as scene from "./scene.js";
import { subscribe, set, state } from "./store.js";
import { startRegister } from "./register.js";
import { startSweeps } from "./sweep-panel.js";
import * as timeline from "./timeline.js";
import * as whatif from "./whatif-panel.js";

const THEMES = { light: "moon", dark: "sun" };

function startTheme() {
  const draw = () => fill("theme", icon(THEMES[state().theme]));
  document.getElementById("theme").addEventListener("click", () => {
    const theme = state().theme === "dark" ? "light" : "dark";
    localStorage.setItem("palpate.theme", theme);
    document.documentElement.dataset.theme = theme;
    set({ theme });
  });
  subscribe(["theme"], draw);
  draw();
}

/** Shown to those who came in with a token. */
function startLogOut() {
  const form = document.getElementById("log-out");
  form.hidden = !/(^|; )palpate_inside=1/.test(document.cookie);
  fill(form.firstElementChild, icon("leave"));
}

async function openRun(id) {
  set({ playing: false });
  try {
    const [heading, report, patterns] = await Promise.all([
      get(`/runs/${id}`),
      get(`/runs/${id}/report`),
      get(`/runs/${id}/patterns`).catch(() => null),
    ]);
    const known = heading.sequences.map(({ name }) => name);
    const sequence =
      state().run === id && known.includes(state().sequence)
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

/** The test sequence on which naming the cause changes most: what a visitor should see first. */
function preferredSequence(sequences) {
  const tested = sequences.filter(({ split }) => split === "test");
  const gain = ({ distance_raw: raw, distance_extended: extended }) => (raw ?? 0) - (extended ?? 0);
  return (
    [...(tested.length ? tested : sequences)].sort((a, b) => gain(b) - gain(a))[0]?.name ?? null
  );
}

async function openSequence() {
  const { run, sequence } = state();
  if (!run || !sequence) return;
  const series = await get(`/runs/${run}/sequences/${encodeURIComponent(sequence)}`);
  if (state().run !== run || state().sequence !== sequence) return;
  const fresh = state().series === null || state().series.name !== sequence;
  set({ series });
  if (fresh && state().frame === 0) timeline.go(firstFrameShown(series));
}

/** The frame in which naming the cause changes most, else the one with the largest raw error: the sensor's noise is no first sight. */
function firstFrameShown({ distance_raw: raw, distance_extended: extended }) {
  const gain = raw.map((error, frame) => (error ?? 0) - (extended?.[frame] ?? error ?? 0));
  return indexOfHighest(gain.some((value) => value > 0) ? gain : raw);
}

const indexOfHighest = (values) =>
  values.reduce((best, value, index) => ((value ?? 0) > (values[best] ?? 0) ? index : best), 0);

async function start() {
  startTheme();
  startLogOut();
  const palette = await get("/palette");
  set({ palette });
  timeline.start();
  startSweeps();
  correction.start(() => openSequence().catch(toast));
  startRegister(rail.openDataset);
  startHelp();
  scene.start();
  whatif.start();
  live.start();
  subscribe(["sequence"], () => {
    set({ series: null, frame: 0, loop: null });
    openSequence().catch(toast);
  });
  // What a person chooses comes to the front at once, what merely loads never does: they may have gone elsewhere meanwhile.
  const datasets = await rail.start((id) => {
    openPanel("report");
    return openRun(id);
  });
  const wanted = new URLSearchParams(location.search).get("run") ?? state().run;
  const run = rail.runToOpen(wanted);
  if (run) await openRun(run);
  else {
    set({ run: null, sequence: null });
    showWelcome(datasets);
  }
}

start().catch(toast);
