// The panel of sweeps: the form, the points as they arrive, and what they say about each
// parameter.
import { errorCard, errorTitle, get, post, toast } from "./api.js";
import { changedDataNote, element, fill, icon } from "./dom.js";
import { readableName } from "./format.js";
import { addResultOpener } from "./jobs.js";
import { addPanel, openPanel } from "./panels.js";
import { cameraSelect } from "./register.js";
import { state } from "./store.js";
import {
  heldFields,
  heldValues,
  loadEffects,
  parameterLabel,
  parameterOf,
  sweepableParameters,
  unitOf,
  wholeRange,
} from "./sweep-parameters.js";
import { formatErrorChange, formatError, sweepPlot } from "./sweep-plots.js";

/**
 * @import {
 *   DatasetSummary, Job, PlotAxis, Sweep, SweepBounds, SweepDirection, SweepPoint
 * } from "./types.js"
 */

/** @type {[string, string][]} */
const METHODS = [
  ["grid", "Grid, coarse to fine"],
  ["random", "Random"],
  ["tpe", "TPE"],
  ["cmaes", "CMA-ES"],
];
const PAUSE = 700; // between requests for new points [ms]
/** @typedef {{ error: number, number: number, values: Record<string, number> }} BestPoint */
/** @type {SweepBounds[]} */
let axes = []; // of the form
/** @type {Record<string, number | string>} */
let held = {}; // values [SI] set by hand of parameters that are not swept
/** @type {number | null} */
let chosen = null; // number of the point that was clicked; null for the best
/** @type {HTMLElement} */
let box;
/** @type {string | null} */
let followedId = null; // the sweep that is shown; null while the form is

/** Add the panel. */
export function startSweeps() {
  box = addPanel(
    "sweep",
    "Sweep",
    () => (followedId ? null : openForm()),
    () => {
      followedId = null;
    },
  );
  addResultOpener("sweep", "Open the sweep", (id) => {
    followedId = id;
    openPanel("sweep");
    followSweep(id);
  });
}

/** Show the form. */
async function openForm() {
  try {
    const { datasets, folder } = await get("/datasets");
    if (!axes.length) axes = [{ name: "poisson_ratio.nu", low: 0.3, high: 0.49 }];
    await showForm(datasets, folder);
  } catch (problem) {
    fill(box, errorCard(problem));
  }
}

/**
 * @param {string[]} datasets
 * @param {string} folder
 */
async function showForm(datasets, folder) {
  /** @type {{ id: string, job: Job | null }[]} */
  const old = await get("/sweeps");
  if (!datasets.length) {
    fill(
      box,
      element(
        "div",
        { class: "empty-panel" },
        element("h1", {}, "No dataset yet"),
        element(
          "p",
          {},
          "A sweep compares replays with clouds. " +
            `Put a dataset folder into ${folder} and open this panel again.`,
        ),
      ),
    );
    return;
  }
  /**
   * @param {string} name
   * @param {[string, string][]} entries
   * @returns {HTMLSelectElement}
   */
  const select = (name, entries) =>
    element(
      "select",
      { name },
      entries.map(([value, label]) => element("option", { value }, label)),
    );
  /**
   * @param {string} name
   * @param {number} value
   * @param {number} low
   * @param {number} high
   * @returns {HTMLInputElement}
   */
  const number = (name, value, low, high) =>
    element("input", { name, type: "number", value, min: low, max: high, step: 1, required: true });
  const dataset = select(
    "dataset",
    datasets.map((name) => /** @type {[string, string]} */ ([name, name])),
  );
  const current = state().heading?.folder;
  if (current && datasets.includes(current)) dataset.value = current;
  await loadEffects(dataset.value);
  const sequences = element("select", {
    name: "sequences",
    multiple: true,
    size: 3,
    "aria-label": "Sequences; all with clouds where none is chosen",
  });
  const cameras = element("div");
  const listCameras = async () => {
    const name = dataset.value;
    const choice = await cameraSelect(name);
    if (dataset.value !== name) return;
    fill(cameras, choice.hidden ? null : element("label", {}, "Camera", choice));
  };
  dataset.addEventListener("change", listCameras);
  const listSequences = async () => {
    const shown = dataset.value;
    fill(sequences);
    /** @type {Pick<DatasetSummary, "sequences">} */
    const summary = await get(`/datasets/${encodeURIComponent(shown)}`).catch(() => ({
      sequences: [],
    }));
    if (dataset.value !== shown) return;
    fill(
      sequences,
      summary.sequences
        .filter(({ clouds }) => clouds)
        .map(({ name }) => element("option", { value: name }, name)),
    );
  };
  dataset.addEventListener("change", listSequences);
  const method = select("method", METHODS);
  const gridOnly = element(
    "div",
    { class: "pair" },
    element("label", {}, "Steps along each", number("steps", 7, 2, 1000)),
    element("label", {}, "Levels, coarse to fine", number("levels", 1, 1, 12)),
  );
  const others = element("label", { hidden: true }, "Points", number("points", 40, 1, 20000));
  method.addEventListener("change", () => {
    gridOnly.hidden = method.value !== "grid";
    others.hidden = method.value === "grid";
  });
  const rows = element("div", { class: "sweep-form" });
  const drawRows = () => {
    fill(
      rows,
      axes.map((axis) => axisRow(axis, drawRows)),
      heldFields(axes, held),
    );
  };
  drawRows();
  dataset.addEventListener("change", async () => {
    const name = dataset.value;
    start.disabled = true;
    fill(rows, element("p", { class: "muted" }, "Reading the phantom …"));
    await loadEffects(name).catch(toast);
    if (dataset.value !== name) return;
    start.disabled = false;
    // Places in another phantom are none in this one.
    held = {};
    axes = axes.flatMap((axis) => {
      const item = parameterOf(axis.name);
      if (item?.impossible) return [];
      return item?.span ? [wholeRange(item)] : [axis];
    });
    if (!axes.length) axes = [{ name: "poisson_ratio.nu", low: 0.3, high: 0.49 }];
    drawRows();
  });
  const start = element("button", { class: "button strong", type: "submit" }, "Start the sweep");
  const form = element(
    "form",
    {
      class: "sweep-form",
      onsubmit: async (event) => {
        event.preventDefault();
        start.disabled = true;
        const values = new FormData(form);
        const request = {
          dataset: dataset.value,
          registration: values.get("registration") || null,
          parameters: axes.map(({ name, low, high }) => ({ parameter: name, low, high })),
          fixed: heldValues(axes, held),
          method: method.value,
          measure: values.get("measure"),
          frames: Number(values.get("frames")),
          sequences: [...sequences.selectedOptions].map(({ value }) => value),
          ...(method.value === "grid"
            ? { steps: Number(values.get("steps")), levels: Number(values.get("levels")) }
            : { points: Number(values.get("points")) }),
        };
        try {
          followSweep((await post("/sweeps", request)).id);
        } catch (refused) {
          start.disabled = false;
          form.querySelector(".note-card")?.remove();
          form.append(errorCard(refused));
        }
      },
    },
    element("label", {}, "Dataset", dataset),
    element("label", {}, "Sequences (none chosen: all)", sequences),
    cameras,
    element("h2", {}, "Parameters"),
    rows,
    element(
      "button",
      {
        class: "button",
        type: "button",
        onclick: () => {
          const next = sweepableParameters().find(
            ({ key, impossible }) => !impossible && !axes.some(({ name }) => name === key),
          );
          if (next) axes.push(wholeRange(next));
          drawRows();
        },
      },
      "Add a parameter",
    ),
    element("label", {}, "Method", method),
    gridOnly,
    others,
    element(
      "div",
      { class: "pair" },
      element("label", {}, "Clouds of each sequence", number("frames", 8, 1, 1000)),
      element(
        "label",
        {},
        "Error",
        select("measure", [
          ["distance", "RMS of patch averages"],
          ["paper", "Mean distance (paper)"],
        ]),
      ),
    ),
    element("div", { class: "actions" }, start),
  );
  fill(
    box,
    element("div", { class: "eyebrow" }, "Sweep"),
    element("h1", { class: "verdict" }, "How does the error depend on what is assumed?"),
    form,
    old.length
      ? element(
          "section",
          {},
          element("h2", {}, "Sweeps so far"),
          element(
            "div",
            { class: "sweep-list" },
            old
              .slice(0, 12)
              .map(({ id, job }) =>
                element(
                  "button",
                  { type: "button", "data-sweep": id, onclick: () => followSweep(id) },
                  element("span", {}, id),
                  element("span", { class: "muted" }, job?.state ?? "on disk"),
                ),
              ),
          ),
        )
      : null,
  );
  await Promise.all([listSequences(), listCameras()]);
}

/**
 * Create the form's row for a swept parameter.
 * @param {SweepBounds} axis
 * @param {() => void} redraw
 * @returns {HTMLElement}
 */
function axisRow(axis, redraw) {
  const [factor, unit] = unitOf(axis.name);
  /**
   * @param {"low" | "high"} key
   * @param {string} label
   * @returns {HTMLElement}
   */
  const bound = (key, label) => {
    const field = element("input", {
      type: "number",
      step: "any",
      required: true,
      value: +(axis[key] * factor).toPrecision(5),
      "aria-label": `${label} of ${axis.name}`,
    });
    field.addEventListener("change", () => {
      axis[key] = field.value === "" ? NaN : +field.value / factor;
    });
    return element("label", {}, `${label}${unit ? `, ${unit}` : ""}`, field);
  };
  const choice = element(
    "select",
    { "aria-label": "Parameter" },
    sweepableParameters().map(({ key, label, impossible }) =>
      element(
        "option",
        { value: key, selected: key === axis.name, disabled: Boolean(impossible) },
        impossible ? `${label} – ${impossible}` : label,
      ),
    ),
  );
  choice.addEventListener("change", () => {
    const item = parameterOf(choice.value);
    if (item) Object.assign(axis, wholeRange(item));
    redraw();
  });
  return element(
    "div",
    { class: "sweep-axis" },
    element("label", {}, "Parameter", choice),
    bound("low", "from"),
    bound("high", "to"),
    element(
      "button",
      {
        class: "icon-button",
        type: "button",
        title: "Leave this parameter out",
        disabled: axes.length < 2,
        onclick: () => {
          axes = axes.filter((other) => other !== axis);
          redraw();
        },
      },
      icon("close"),
    ),
  );
}

/**
 * Draw a sweep until it has ended or the panel shows something else.
 * @param {string} id
 */
async function followSweep(id) {
  followedId = id;
  chosen = null;
  /** @type {SweepPoint[]} */
  let points = [];
  let next = 0;
  const [stop, replay] = [stopButton(id), replayButton(id)];
  while (followedId === id) {
    try {
      /** @type {[Sweep, { points: SweepPoint[], next: number }, void]} */
      const [sweep, more] = await Promise.all([
        get(`/sweeps/${id}`),
        get(`/sweeps/${id}/points?after=${next}`),
        loadEffects(),
      ]);
      if (followedId !== id) return;
      points = points.concat(more.points);
      next = more.next;
      const byNumber = new Map(points.map((point) => [point.number, point]));
      const drawn = () => draw(sweep, [...byNumber.values()], stop, replay, drawn);
      drawn();
      const ended = !sweep.job || !["queued", "running"].includes(sweep.job.state);
      if (ended && !more.points.length) return;
    } catch (problem) {
      fill(box, errorCard(problem), backButton());
      return;
    }
    await new Promise((done) => setTimeout(done, PAUSE));
  }
}

/**
 * Create the button that shows the form again.
 * @returns {HTMLElement}
 */
const backButton = () =>
  element(
    "button",
    {
      class: "button",
      type: "button",
      onclick: () => {
        followedId = null;
        openForm();
      },
    },
    "Another sweep",
  );

/**
 * Create the button that stops a sweep.
 * @param {string} id
 * @returns {HTMLElement}
 */
function stopButton(id) {
  const button = element(
    "button",
    {
      class: "button",
      type: "button",
      onclick: async () => {
        button.disabled = true;
        await post(`/sweeps/${id}/cancel`).catch((problem) => {
          toast(problem);
          button.disabled = false;
        });
      },
    },
    "Stop",
  );
  return button;
}

/**
 * Create the button that replays the swept sequences with the values of the chosen point.
 * @param {string} id
 * @returns {HTMLButtonElement}
 */
function replayButton(id) {
  const button = element(
    "button",
    {
      class: "button",
      type: "button",
      title: "The swept sequences, every frame, with the values of this point, as a job",
      onclick: async () => {
        button.disabled = true;
        try {
          await post("/replays", await get(`/sweeps/${id}/points/${button.value}/replay`));
          openPanel("jobs");
        } catch (problem) {
          toast(problem);
        }
        button.disabled = false;
      },
    },
    "Replay this point",
  );
  return button;
}

/**
 * Create the line that names the chosen point, or the best, with the button that replays it.
 * @param {SweepPoint | null} point
 * @param {PlotAxis[]} drawn
 * @param {HTMLButtonElement} replay
 * @returns {HTMLElement | null}
 */
function chosenPoint(point, drawn, replay) {
  if (!point) return null;
  replay.value = String(point.number);
  const where = drawn
    .map(({ name, label }) => `${label} ${formatValue(name, point.values[name])}`)
    .join(", ");
  return element(
    "div",
    { class: "sweep-point", "data-chosen": point.number },
    element("span", {}, `${where}: ${point.error === null ? "failed" : formatError(point.error)}`),
    replay,
  );
}

/**
 * @param {Sweep} sweep
 * @param {SweepPoint[]} points
 * @param {HTMLElement} stop button that stays the same from call to call, so that it can be pressed
 * @param {HTMLButtonElement} replay likewise
 * @param {() => void} again draws the same with another chosen point
 */
function draw(sweep, points, stop, replay, again) {
  const { id, job, request, summary } = sweep;
  const running = job && ["queued", "running"].includes(job.state) ? job : null;
  const swept = points.filter(({ kind }) => kind !== "stated");
  const stated = points.find(({ kind }) => kind === "stated")?.error ?? null;
  const best = swept.reduce(
    (/** @type {BestPoint | null} */ one, { error, number, values }) =>
      error === null || (one && one.error <= error) ? one : { error, number, values },
    null,
  );
  /** @type {PlotAxis[]} */
  const drawn = (request?.parameters ?? []).map(({ parameter: name, low, high }) => ({
    name,
    low,
    high,
    log: low > 0 && high / low > 30,
    label: readableName(name.split(".")[1]),
    stated: summary?.stated_values?.[name],
    unit: unitOf(name)[1],
    show: (value) => formatValue(name, value),
    plain: (value) => `${+(value * unitOf(name)[0]).toPrecision(3)}`,
  }));
  const failed = swept.filter(({ error }) => error === null);
  fill(
    box,
    element(
      "div",
      { class: "eyebrow" },
      element("span", {}, id),
      job
        ? element("span", { class: "verdict-tag none", "data-state": job.state }, job.state)
        : null,
    ),
    element("h1", { class: "verdict" }, summary?.sentence ?? sentence(best, running !== null)),
    changedDataNote(sweep),
    running
      ? element(
          "div",
          {},
          element(
            "div",
            { class: "sweep-progress" },
            element("i", { style: { width: `${100 * running.fraction}%` } }),
          ),
          element("p", { class: "gain-note" }, running.text),
        )
      : null,
    job?.error
      ? element(
          "div",
          { class: "note-card bad" },
          element("strong", {}, errorTitle(job.error)),
          job.error.message,
        )
      : null,
    swept.length
      ? element(
          "section",
          {
            onclick: (event) => {
              const point = event.target.closest("[data-point]")?.getAttribute("data-point");
              if (!point) return;
              chosen = Number(point);
              again();
            },
          },
          sweepPlot(drawn, swept, stated, best?.number, summary?.at_rest),
          element(
            "div",
            { class: "sweep-keys" },
            drawn.length < 3
              ? element(
                  "span",
                  {},
                  element("i", { style: { background: "var(--accent)" } }),
                  "best",
                )
              : null,
            drawn.length === 1 ? element("span", {}, "- - as stated") : null,
            drawn.length === 1 && summary?.at_rest !== undefined
              ? element("span", {}, "··· untouched phantom")
              : null,
            drawn.length > 2 ? element("span", {}, "thick: the best") : null,
            failed.length
              ? element("span", { "data-failures": failed.length }, `✕ ${failed.length} failed`)
              : null,
            element("span", {}, "click on a point to choose it"),
          ),
          chosenPoint(
            swept.find(({ number }) => number === (chosen ?? best?.number)) ?? null,
            drawn,
            replay,
          ),
          heldNote(request?.fixed ?? {}),
        )
      : null,
    summary?.directions.length
      ? element(
          "section",
          {},
          element("h2", {}, "What each parameter does"),
          summary.directions.map(directionCard),
        )
      : null,
    failed.length
      ? element(
          "section",
          {},
          element("h2", {}, "Failed"),
          [...new Set(failed.map(({ failure }) => failure))]
            .slice(0, 5)
            .map((text) => element("div", { class: "note-card" }, text)),
        )
      : null,
    element("div", { class: "actions" }, running ? stop : null, backButton()),
  );
}

/**
 * @param {string} name
 * @param {number} value
 * @returns {string}
 */
function formatValue(name, value) {
  const [factor, unit] = unitOf(name);
  return `${+(value * factor).toPrecision(3)}${unit ? ` ${unit}` : ""}`;
}

/**
 * Say at what the other parameters were held; null where none was.
 * @param {Record<string, number | string>} fixed [SI]
 * @returns {HTMLElement | null}
 */
function heldNote(fixed) {
  const said = Object.entries(fixed).map(([name, value]) => {
    const shown = typeof value === "number" ? formatValue(name, value) : value;
    return `${readableName(name.split(".")[1])} ${shown}`;
  });
  return said.length ? element("p", { class: "gain-note" }, `Held at ${said.join(", ")}.`) : null;
}

/**
 * Say the least error so far; where it lies is said when all points are there.
 * @param {BestPoint | null} best
 * @param {boolean} running
 * @returns {string}
 */
function sentence(best, running) {
  if (!best) return running ? "Reading the clouds …" : "No point has an error.";
  return `Least error so far ${formatError(best.error)}.`;
}

/**
 * Create the card that says whether a parameter matters.
 * @param {SweepDirection} direction
 * @returns {HTMLElement}
 */
const directionCard = ({ name, flat, change, low, high, little, least, edge }) => {
  const verdict = flat === null ? "unknown" : flat ? "flat" : little ? "matters little" : "matters";
  const [lowest, highest] = [formatErrorChange(low), formatErrorChange(high)];
  return element(
    "div",
    { class: "note-card", "data-direction": name, "data-flat": String(flat) },
    element("strong", {}, `${parameterLabel(name)}: ${verdict}`),
    flat
      ? "The error does not change along it beyond what drawing the pushes anew changes: " +
          "these clouds cannot tell it. "
      : flat === null
        ? "Only one push was compared, so nobody knows what chance does; " +
          "take more sequences or clouds. "
        : little
          ? "The change is sure, but smaller than a model and a real phantom differ anyway. "
          : "",
    `From best to worst the error changes by ${formatErrorChange(change)}`,
    flat === null ? "." : ` (95 % interval ${lowest} to ${highest}).`,
    least && !little
      ? ` It is least from ${formatValue(name, least[0])} to ${formatValue(name, least[1])}` +
          " (95 % of the pushes drawn anew)."
      : "",
    edge ? " The least lies at the edge of the range: widen it." : "",
  );
};
