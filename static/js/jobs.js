// Jobs as they go: the newest few on the left, all of them with log and retry in a panel of their own.
import { get, post, toast } from "./api.js";
import { diskUsageLine } from "./disk-usage.js";
import { element, fill, icon } from "./dom.js";
import { capitalise, formatDuration, formatDateTime } from "./format.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";

const JUST_ENDED = 15 * 60;
const RETRY = { sweep: "Resume", training: "Resume" };
const LEVELS = { warning: "⚠ ", error: "✕ " };
const listeners = [];
const openers = {};
const rows = new Map();
let jobs = [];
let panel = null;

/** Call `listener(jobs that have just ended well)` whenever some have. */
export const onJobsDone = (listener) => listeners.push(listener);

/** How to open what a job made: by the key of its result, a label and a function of its value. */
export function addResultOpener(key, label, open) {
  openers[key] = { label, open };
}

/** Follow the server's list. */
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
    if (done.length && panel.firstChild)
      document.getElementById("disk")?.replaceWith(diskUsageLine());
    if (done.length) for (const listener of listeners) listener(done);
  };
  setInterval(draw, 1000);
}

const isOpen = ({ state }) => state === "running" || state === "queued";
const isRecent = ({ state, finished }) =>
  state !== "done" && Date.now() / 1e3 - finished < JUST_ENDED;

function draw() {
  const shown = jobs.filter((job) => isOpen(job) || isRecent(job)).slice(0, 6);
  placeRows(document.getElementById("jobs"), shown, "rail", "Nothing is running.");
  if (openedPanel() === "jobs") drawPanel();
}

function drawPanel() {
  if (!panel.firstChild)
    fill(
      panel,
      element("div", { class: "eyebrow" }, "Jobs"),
      element("h1", { class: "verdict" }, "What was asked for, and what became of it"),
      element("div", { class: "jobs-list" }),
      diskUsageLine(),
    );
  placeRows(
    panel.querySelector(".jobs-list"),
    jobs,
    "panel",
    "Nothing has been asked for yet: diagnose a dataset, or start a sweep.",
  );
}

/** Put rows into a box in order; a row is built anew only when its job's state changes, so that buttons stay where they are. */
function placeRows(box, shown, where, empty) {
  const wanted = shown.map((job) => {
    const key = `${where} ${job.id}`;
    const mark = `${job.state} ${job.attempt}`;
    let row = rows.get(key);
    if (row?.mark !== mark) {
      row = { mark, ...buildRow(job, where === "panel") };
      rows.set(key, row);
    }
    row.update(job);
    return row.node;
  });
  const nodes = wanted.length
    ? wanted
    : [box.querySelector(".empty") ?? element("p", { class: "empty" }, empty)];
  if (
    nodes.length !== box.children.length ||
    nodes.some((node, place) => box.children[place] !== node)
  )
    box.replaceChildren(...nodes);
}

function buildRow(job, wide) {
  const { id, kind, dataset, state, error, finished, started, can_retry: retriable } = job;
  const active = isOpen(job);
  const share = element("span", { class: "value muted" }, active ? "" : state);
  const bar = element("i");
  const text = element("span");
  const left = element("span");
  const say =
    (path) =>
    async ({ currentTarget }) => {
      currentTarget.disabled = true;
      await post(`/jobs/${id}/${path}`).catch((problem) => {
        toast(problem);
        currentTarget.disabled = false;
      });
    };
  const buttons = [
    active
      ? element(
          "button",
          { class: "icon-button", type: "button", title: "Cancel", onclick: say("cancel") },
          icon("close"),
        )
      : null,
    retriable
      ? element(
          "button",
          { class: "button small", type: "button", "data-retry": id, onclick: say("retry") },
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
  const update = ({ fraction, text: said, remaining, started: since }) => {
    if (active) share.textContent = `${Math.round(100 * fraction)} %`;
    bar.style.width = `${100 * fraction}%`;
    text.textContent = said;
    left.textContent =
      state !== "running"
        ? ""
        : remaining !== null
          ? `about ${formatDuration(remaining)} left`
          : formatDuration(Date.now() / 1e3 - since);
  };
  return { node, update };
}

/** A way to each thing that the job made. */
function resultLinks({ id, dataset, result }) {
  return Object.entries(openers)
    .filter(([key]) => result?.[key] !== undefined)
    .map(([key, { label, open }]) =>
      element(
        "button",
        {
          class: "button small",
          type: "button",
          "data-open": key,
          onclick: () => open(result[key], id, result),
        },
        label,
      ),
    )
    .concat(
      (result?.files ?? []).map((file) =>
        element(
          "a",
          {
            class: "button small",
            href: `/api/exports/${encodeURIComponent(result.export)}/${encodeURIComponent(file)}`,
            download: file,
          },
          dataset ? file.replace(`${dataset}-`, "").replace(`${dataset}.`, "report.") : file,
        ),
      ),
    );
}

/** The job's log, read when it is opened and followed while it is. */
function jobLog(id) {
  const lines = element("ol", { class: "log" });
  const box = element("details", { ontoggle: follow }, element("summary", {}, "Log"), lines);
  let next = 0;
  let busy = false;
  async function follow() {
    while (box.open && box.isConnected && !busy) {
      busy = true;
      try {
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
