// Entry point of the page: starts its modules.
import { get, toast } from "./api.js";
import * as correction from "./correction-panel.js";
import { byId, fill, icon } from "./dom.js";
import { startHelp } from "./help.js";
import { openLook, startImports } from "./import-panel.js";
import * as live from "./live-panel.js";
import { startLogOut } from "./log-out.js";
import { openRun, openSequence } from "./open-run.js";
import { openPanel } from "./panels.js";
import * as sidebar from "./sidebar.js";
import { showWelcome } from "./report-panel.js";
import * as scene from "./scene.js";
import { subscribe, set, state } from "./store.js";
import { startRegister } from "./register.js";
import { startSweeps } from "./sweep-panel.js";
import * as timeline from "./timeline.js";
import * as whatif from "./whatif-panel.js";

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

/** Start everything, and open the run of the address, the last one or the newest. */
async function start() {
  startTheme();
  startLogOut();
  const palette = await get("/palette");
  set({ palette });
  timeline.start();
  startImports(sidebar.openDataset);
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
  const asked = new URLSearchParams(location.search);
  const look = asked.get("look");
  const id = asked.get("run") ?? state().run;
  const run = sidebar.runToOpen(id);
  if (run) await openRun(run);
  else {
    set({ run: null, sequence: null });
    showWelcome(datasets > 0);
  }
  if (look) openLook(look);
}

start().catch(toast);
