// The panel "Import": recordings are looked at before anything is made of them, cut by hand, and
// imported as a dataset.
import { errorCard, toast } from "./api.js";
import { element, fill } from "./dom.js";
import { cutSection } from "./cut-list.js";
import { createImport } from "./import-actions.js";
import { filesSection } from "./import-files.js";
import { finishSection, jobSection } from "./import-finish.js";
import { addressOf } from "./import-memory.js";
import { problemAt } from "./import-problems.js";
import { meaningSection, setupSection } from "./import-setup.js";
import { streamsSection } from "./import-streams.js";
import { addResultOpener } from "./jobs.js";
import {
  closeLookScene,
  onLookSceneKey,
  openLookScene,
  showInScene,
  startLookScene,
} from "./look-scene.js";
import { drawTimeline, forgetView, pressKey, startLookTimeline } from "./look-timeline.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";

/** @import { ServerError } from "./types.js" */

/** @type {HTMLElement} */
let box;
/** @type {ReturnType<typeof createImport>} */
let work;
let waiting = false; // a drawing of the panel is due
/** @type {ServerError | null} */
let said = null; // the problem that was brought into sight
/** @type {EventTarget | null} */
let taken = null; // the field whose value was taken since the last drawing

/**
 * Add the panel, its scene and its timeline.
 * @param {(dataset: string, said?: string[]) => unknown} openDataset
 */
export function startImports(openDataset) {
  box = addPanel("import", "Import", open, leave);
  startLookScene();
  work = createImport({ redraw, openDataset, opened: forgetView });
  startLookTimeline({
    recording: work.recording,
    recordings: () => work.view.look?.recordings ?? [],
    editor: work.editor,
    sequences: work.sequences,
    time: () => work.view.time,
    goTo: work.actions.goTo,
    choose: work.actions.chooseRecording,
    rename: (key) => {
      const field = /** @type {HTMLInputElement | null} */ (
        box.querySelector(`[data-key="name ${key}"]`)
      );
      field?.focus();
      field?.select();
    },
  });
  box.addEventListener("change", ({ target }) => {
    taken = target;
  });
  window.addEventListener("keydown", onKeyDown, true);
  onLookSceneKey(onKeyDown);
  addResultOpener("look", "Open the look", openLook);
}

/**
 * Bring the panel to the front with a look.
 * @param {string} id
 */
export function openLook(id) {
  openPanel("import");
  work.actions.openLook(id);
}

/**
 * Bring the panel to the front and look at a dataset.
 * @param {string} name
 */
export function lookAtDataset(name) {
  openPanel("import");
  work.lookAtDataset(name).catch(toast);
}

/**
 * Bring the panel to the front and take files that were dropped: a single .toml beside a look is
 * its setup, all else are new recordings.
 * @param {File[]} files
 * @param {string[]} folders names of folders among what was dropped, which cannot be sent
 */
export function takeFiles(files, folders) {
  openPanel("import");
  const [first] = files;
  if (work.recording() && files.length === 1 && first.name.endsWith(".toml")) {
    first
      .text()
      .then((text) => work.actions.setSetup({ kind: "file", name: first.name, text }), toast);
    return;
  }
  if (work.view.look) work.actions.startOver();
  work.actions.addFiles(files, folders);
}

/** Show scene and timeline of the look in place of those of a run. */
function open() {
  document.body.classList.add("importing");
  openLookScene();
  addressOf(work.view.id);
  work.refresh();
  draw();
}

/** Show the page's scene again. */
function leave() {
  document.body.classList.remove("importing");
  closeLookScene();
  addressOf(null);
}

/** Draw what has changed, once all that happens now has happened. */
function redraw() {
  if (openedPanel() !== "import" || waiting) return;
  waiting = true;
  setTimeout(() => {
    waiting = false;
    if (openedPanel() === "import") draw();
  });
}

function draw() {
  const { view, actions } = work;
  const editor = work.editor();
  const recording = work.recording();
  document.body.classList.toggle("looking", recording !== null);
  showInScene(
    view.id && view.look && recording
      ? { id: view.id, look: view.look, recording, time: view.time }
      : null,
  );
  drawTimeline();
  const looked = view.look !== null;
  const shown = view.problem ?? view.look?.error ?? null;
  /** @param {import("./import-problems.js").Step} step */
  const at = (step) => problemAt(shown, step, looked);
  keepingFocus(() => {
    try {
      fill(
        box,
        element("div", { class: "eyebrow" }, "Import"),
        element("h1", { class: "verdict" }, title()),
        filesSection(view, actions, at("files")),
        view.job?.kind === "import" ? null : jobSection(view, actions),
        streamsSection(view, actions, at("streams")),
        setupSection(view, actions, at("setup")),
        meaningSection(view, actions, at("meaning")),
        cutSection(view, editor, work.sequences, actions, at("cut")),
        finishSection(view, editor, actions, { name: at("name"), other: at("other") }),
      );
    } catch (problem) {
      fill(box, errorCard(problem));
    }
  });
  if (view.problem && view.problem !== said)
    box.querySelector("[data-problem]")?.scrollIntoView({ block: "center" });
  said = view.problem;
}

/** @returns {string} */
function title() {
  const { look } = work.view;
  if (!look) return "From recordings to a dataset";
  return look.source.kind === "dataset"
    ? `A look at ${look.source.name}`
    : "What the recordings hold";
}

/**
 * Draw the panel anew; the field that had the focus has it again, and open details stay open.
 * @param {() => void} drawPanel
 */
function keepingFocus(drawPanel) {
  const active = box.contains(document.activeElement)
    ? /** @type {HTMLElement} */ (document.activeElement)
    : null;
  const key = active?.dataset.key;
  const typed = active instanceof HTMLInputElement && active.type !== "file" ? active : null;
  const marks = typed?.type === "text" ? [typed.selectionStart, typed.selectionEnd] : null;
  const value = typed === taken ? undefined : typed?.value;
  taken = null;
  const closed = new Map(
    [...box.querySelectorAll("details")].map((one) => [summaryOf(one), one.open]),
  );
  const scrolled = box.scrollTop;
  drawPanel();
  for (const one of box.querySelectorAll("details"))
    one.open = closed.get(summaryOf(one)) ?? one.open;
  box.scrollTop = scrolled;
  if (!key) return;
  const again = /** @type {HTMLElement | null} */ (
    box.querySelector(`[data-key="${CSS.escape(key)}"]`)
  );
  again?.focus({ preventScroll: true });
  if (!(again instanceof HTMLInputElement)) return;
  if (value !== undefined) again.value = value;
  if (marks) again.setSelectionRange(marks[0], marks[1]);
}

/**
 * @param {HTMLDetailsElement} details
 * @returns {string}
 */
const summaryOf = (details) =>
  (details.querySelector("summary")?.textContent ?? "").replace(/ \(\d+\)$/, "");

/**
 * Run the timeline's action of a pressed key, wherever it was pressed, unless a field needs it.
 * @param {KeyboardEvent} event
 */
function onKeyDown(event) {
  if (openedPanel() !== "import" || document.querySelector("dialog[open]")) return;
  const target = /** @type {Element | null} */ (event.target);
  if (target?.matches?.("input, select, textarea, pre")) return;
  if ([" ", "Enter"].includes(event.key) && target?.matches?.("button, summary, a")) return;
  if (["Home", "End"].includes(event.key) && target && box.contains(target)) return;
  if (!pressKey(event)) return;
  event.preventDefault();
  event.stopImmediatePropagation();
}
