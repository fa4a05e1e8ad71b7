// Jobs: the newest few in the sidebar, all of them with log and retry in a panel.
import { get, post, toast } from "./api.js";
import { diskUsage } from "./disk-usage.js";
import { byId, element, fill, icon } from "./dom.js";
import { capitalise, formatDuration, formatDateTime } from "./format.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";

/** @import { Job, LogEntry } from "./types.js" */

/**
 * Opens a result of a job; gets the value, the job's id and the whole result.
 * @typedef {(value: string, id: string, result: Record<string, string>) => unknown} OpenResult
 */
/** @typedef {{ mark: string, node: HTMLElement, update: (job: Job) => void }} JobRow */

const JUST_ENDED = 15 * 60; // for so long a failed job stays in the sidebar [s]
/** @type {Record<string, string>} */
const RETRY = { sweep: "Resume", training: "Resume" };
/** @type {Record<string, string>} */
const LEVELS = { warning: "⚠ ", error: "✕ " };
/** @type {((jobs: Job[]) => void)[]} */
const listeners = [];
/** @type {Record<string, { label: string, open: OpenResult }>} */
const openers = {};
/** @type {Map<string, JobRow>} */
const rows = new Map();
/** @type {Job[]} */
let jobs = [];
/** @type {HTMLElement} */
let panel;

/**
 * Call a function with the jobs that have just ended well.
 * @param {(jobs: Job[]) => void} listener
 */
export const onJobsDone = (listener) => listeners.push(listener);

/** @type {((kind: string, name: string) => unknown)[]} */
const deletionListeners = [];

/**
 * Call the listener with the kind and the name of each result that is deleted on this page.
 * @param {(kind: string, name: string) => unknown} listener
 */
export const onResultDeleted = (listener) => deletionListeners.push(listener);

/**
 * @param {string} kind
 * @param {string} name
 */
function tellDeleted(kind, name) {
  for (const listener of deletionListeners) listener(kind, name);
}

/**
 * Offer a button for jobs whose result has a key.
 * @param {string} key
 * @param {string} label
 * @param {OpenResult} open
 */
export function addResultOpener(key, label, open) {
  openers[key] = { label, open };
}

/** Add the panel and follow the server's list of jobs. */
export function startJobs() {
  panel = addPanel("jobs", "Jobs", drawPanel);
  const events = new EventSource("/api/jobs/events");
  events.onmessage = ({ data }) => {
    const before = new Map(jobs.map(({ id, state }) => [id, state]));
    jobs = JSON.parse(data);
    draw();
    const done = jobs.filter(
      ({ id, state }) => state === "done" && before.has(id) && before.get(id) !== "done",
    );
    if (done.length && panel.firstChild) byId("disk").replaceWith(diskUsage(tellDeleted));
    if (done.length) for (const listener of listeners) listener(done);
  };
  events.addEventListener("trouble", ({ data }) => showTrouble(JSON.parse(data)));
  events.onopen = () => showTrouble(""); // a server that was started again tells its own
  setInterval(draw, 1000);
}

/** @param {string} text what keeps the job queue from working; empty when it works */
function showTrouble(text) {
  byId("trouble").textContent = text && `⚠ ${capitalise(text)}`;
  byId("trouble").hidden = !text;
}

/**
 * @param {Job} job
 * @returns {boolean}
 */
const isOpen = ({ state }) => state === "running" || state === "queued";

/**
 * Return whether a job has failed or was cancelled lately.
 * @param {Job} job
 * @returns {boolean}
 */
const isRecent = ({ state, finished }) =>
  state !== "done" && Date.now() / 1e3 - (finished ?? 0) < JUST_ENDED;

function draw() {
  const shown = jobs.filter((job) => isOpen(job) || isRecent(job)).slice(0, 6);
  placeRows(byId("jobs"), shown, "rail", "Nothing is running.");
  if (openedPanel() === "jobs") drawPanel();
}

function drawPanel() {
  if (!panel.firstChild)
    fill(
      panel,
      element("div", { class: "eyebrow" }, "Jobs"),
      element("h1", { class: "verdict" }, "Running, waiting and finished jobs"),
      element("div", { class: "jobs-list" }),
      diskUsage(tellDeleted),
      element(
        "p",
        { class: "disk muted" },
        element(
          "a",
          { href: "/api/diagnostics", download: "palpate-diagnostics.txt" },
          "Download diagnostics",
        ),
        ": versions, settings, last jobs and the log, to report a fault; no file of a dataset.",
      ),
    );
  placeRows(
    /** @type {HTMLElement} */ (panel.querySelector(".jobs-list")),
    jobs,
    "panel",
    "There are no jobs yet: diagnose a dataset, or start a sweep.",
  );
}

/**
 * Put rows into a box in order. A row is created again only when its job's state changes, so that
 * its buttons stay where they are.
 * @param {HTMLElement} box
 * @param {Job[]} shown
 * @param {"rail" | "panel"} where
 * @param {string} empty text in place of rows
 */
function placeRows(box, shown, where, empty) {
  const ordered = shown.map((job) => {
    const key = `${where} ${job.id}`;
    const mark = `${job.state} ${job.attempt}`;
    let row = rows.get(key);
    if (!row || row.mark !== mark) {
      row = { mark, ...buildRow(job, where === "panel") };
      rows.set(key, row);
    }
    row.update(job);
    return row.node;
  });
  const nodes = ordered.length
    ? ordered
    : [box.querySelector(".empty") ?? element("p", { class: "empty" }, empty)];
  if (
    nodes.length !== box.children.length ||
    nodes.some((node, index) => box.children[index] !== node)
  )
    box.replaceChildren(...nodes);
}

/**
 * @param {Job} job
 * @param {boolean} wide for the panel
 * @returns {Omit<JobRow, "mark">}
 */
function buildRow(job, wide) {
  const { id, kind, dataset, state, error, finished, started, can_retry: retriable } = job;
  const active = isOpen(job);
  const share = element("span", { class: "value muted" }, active ? "" : state);
  const bar = element("i");
  const text = element("span");
  const left = element("span");
  /**
   * @param {"cancel" | "retry"} verb
   * @returns {(event: { currentTarget: HTMLButtonElement }) => Promise<void>}
   */
  const request =
    (verb) =>
    async ({ currentTarget: button }) => {
      button.disabled = true;
      await post(`/jobs/${id}/${verb}`).catch((problem) => {
        toast(problem);
        button.disabled = false;
      });
    };
  const buttons = [
    active
      ? element(
          "button",
          { class: "icon-button", type: "button", title: "Cancel", onclick: request("cancel") },
          icon("close"),
        )
      : null,
    retriable
      ? element(
          "button",
          { class: "button small", type: "button", "data-retry": id, onclick: request("retry") },
          RETRY[kind] ?? "Retry",
        )
      : null,
  ];
  const node = element(
    "div",
    { class: "job", "data-job": id, "data-state": state },
    element(
      "div",
      { class: "head" },
      element(
        "span",
        { class: "name", title: id },
        wide ? `${capitalise(kind)} · ${dataset ?? ""}` : dataset ? `${dataset} · ${kind}` : kind,
      ),
      share,
      ...buttons,
    ),
    active ? element("div", { class: "progress" }, bar) : null,
    error
      ? element("div", { class: "sub bad" }, error.message)
      : element("div", { class: "sub" }, text, left),
    wide
      ? element(
          "div",
          { class: "sub" },
          element("span", {}, formatDateTime(started ?? job.created)),
          element(
            "span",
            {},
            finished && started ? `took ${formatDuration(finished - started)}` : "",
          ),
        )
      : null,
    wide
      ? element("div", { class: "made" }, resultLinks(job), jobLog(id))
      : element(
          "button",
          {
            class: "link",
            type: "button",
            onclick: () => {
              openPanel("jobs");
              panel
                .querySelector(`[data-job="${CSS.escape(id)}"] details`)
                ?.setAttribute("open", "");
            },
          },
          "Details",
        ),
  );
  /** @param {Job} job */
  const update = ({ fraction, text: message, remaining, started: since }) => {
    if (active) share.textContent = `${Math.round(100 * fraction)} %`;
    bar.style.width = `${100 * fraction}%`;
    text.textContent = message;
    left.textContent =
      state !== "running"
        ? ""
        : remaining !== null
          ? `about ${formatDuration(remaining)} left`
          : formatDuration(Date.now() / 1e3 - (since ?? 0));
  };
  return { node, update };
}

/**
 * Create a button or link for each thing that the job made.
 * @param {Job} job
 * @returns {HTMLElement[]}
 */
function resultLinks({ id, dataset, result }) {
  if (!result) return [];
  const { files = [], ...values } = result;
  const buttons = Object.entries(openers)
    .filter(([key]) => key in values)
    .map(([key, { label, open }]) =>
      element(
        "button",
        {
          class: "button small",
          type: "button",
          "data-open": key,
          onclick: () => open(values[key], id, values),
        },
        label,
      ),
    );
  const folder = `/api/exports/${encodeURIComponent(result.export)}`;
  const links = files.map((file) =>
    element(
      "a",
      { class: "button small", href: `${folder}/${encodeURIComponent(file)}`, download: file },
      dataset ? file.replace(`${dataset}-`, "").replace(`${dataset}.`, "report.") : file,
    ),
  );
  return [...buttons, ...links];
}

/**
 * Create the job's log, which is loaded and followed while it is open.
 * @param {string} id
 * @returns {HTMLElement}
 */
function jobLog(id) {
  const lines = element("ol", { class: "log" });
  const box = element("details", { ontoggle: follow }, element("summary", {}, "Log"), lines);
  let next = 0;
  let busy = false;
  /** Load the lines that are new, again and again until the job has ended. */
  async function follow() {
    while (box.open && box.isConnected && !busy) {
      busy = true;
      try {
        /** @type {{ notes: LogEntry[], next: number }} */
        const more = await get(`/jobs/${id}/log?after=${next}`);
        next = more.next;
        lines.append(
          ...more.notes.map(({ at, level, text }) =>
            element(
              "li",
              { class: level },
              element("time", {}, new Date(at * 1e3).toLocaleTimeString()),
              ` ${LEVELS[level] ?? ""}${text}`,
            ),
          ),
        );
      } catch (problem) {
        toast(problem);
        return;
      } finally {
        busy = false;
      }
      if (!jobs.some((job) => job.id === id && isOpen(job))) return;
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
  return box;
}
