// The panel of sweeps: what to move and over which clouds, the points as they come, and what they say.
import { get, post, errorTitle } from "./api.js";
import { element, fill, icon } from "./dom.js";
import { capitalise, readableName } from "./format.js";
import { addResultOpener } from "./jobs.js";
import { addPanel, openPanel } from "./panels.js";
import { cameraSelect } from "./register.js";
import { formatErrorChange as changed, formatError, sweepPlot } from "./sweep-plots.js";

const METHODS = [
  ["grid", "Grid, coarse to fine"],
  ["random", "Random"],
  ["tpe", "TPE"],
  ["cmaes", "CMA-ES"],
];
const UNITS = { m: [1e3, "mm"], Pa: [1e-3, "kPa"], s: [1e3, "ms"] };
const PAUSE = 700;
let effects = null;
let axes = [];
let box = null;
let followedId = null;

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

async function openForm() {
  try {
    const [catalogue, { datasets, folder }] = await Promise.all([
      effects ?? get("/effects"),
      get("/datasets"),
    ]);
    effects = catalogue;
    if (!axes.length) axes = [{ name: "poisson_ratio.nu", low: 0.3, high: 0.49 }];
    await showForm(datasets, folder);
  } catch (problem) {
    fill(box, errorCard(problem));
  }
}

const sweepableParameters = () =>
  effects.flatMap((effect) =>
    effect.parameters
      .filter(({ choices, low, high }) => !choices.length && low !== null && high !== null)
      .map((item) => ({
        ...item,
        key: `${effect.name}.${item.name}`,
        label:
          effect.parameters.length > 1
            ? `${capitalise(readableName(effect.name))}: ${readableName(item.name)}`
            : capitalise(readableName(effect.name)),
      })),
  );
const parameterOf = (name) => sweepableParameters().find(({ key }) => key === name);
const unitOf = (name) =>
  UNITS[parameterOf(name)?.unit] ?? [
    1,
    parameterOf(name)?.unit === "1" ? "" : (parameterOf(name)?.unit ?? ""),
  ];
const errorCard = (problem) =>
  element(
    "div",
    { class: "note-card bad", role: "alert" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );

async function showForm(datasets, folder, problem = null) {
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
          `A sweep compares replays with clouds. Put a dataset folder into ${folder} and open this panel again.`,
        ),
      ),
    );
    return;
  }
  const select = (name, entries) =>
    element(
      "select",
      { name },
      entries.map(([value, label]) => element("option", { value }, label)),
    );
  const number = (name, value, low, high) =>
    element("input", { name, type: "number", value, min: low, max: high, step: 1, required: true });
  const dataset = select(
    "dataset",
    datasets.map((name) => [name, name]),
  );
  const sequences = element("select", {
    name: "sequences",
    multiple: true,
    size: 3,
    "aria-label": "Sequences; all with clouds where none is chosen",
  });
  const cameras = element("div");
  const listCameras = async () => {
    const choice = await cameraSelect(dataset.value);
    fill(cameras, choice.hidden ? null : element("label", {}, "Camera", choice));
  };
  dataset.addEventListener("change", listCameras);
  const listSequences = async () => {
    const summary = await get(`/datasets/${encodeURIComponent(dataset.value)}`).catch(() => ({
      sequences: [],
    }));
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
  const drawRows = () =>
    fill(
      rows,
      axes.map((axis) => axisRow(axis, drawRows)),
    );
  drawRows();
  const start = element("button", { class: "button strong", type: "submit" }, "Start the sweep");
  const form = element(
    "form",
    {
      class: "sweep-form",
      onsubmit: async (event) => {
        event.preventDefault();
        start.disabled = true;
        const values = new FormData(form);
        const asked = {
          dataset: dataset.value,
          registration: values.get("registration") || null,
          parameters: axes.map(({ name, low, high }) => ({ parameter: name, low, high })),
          method: method.value,
          measure: values.get("measure"),
          frames: +values.get("frames"),
          sequences: [...sequences.selectedOptions].map(({ value }) => value),
          ...(method.value === "grid"
            ? { steps: +values.get("steps"), levels: +values.get("levels") }
            : { points: +values.get("points") }),
        };
        try {
          followSweep((await post("/sweeps", asked)).id);
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
            ({ key }) => !axes.some(({ name }) => name === key),
          );
          axes.push({ name: next.key, low: next.low, high: next.high });
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
    problem ? errorCard(problem) : null,
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

function axisRow(axis, redraw) {
  const [factor, unit] = unitOf(axis.name);
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
    sweepableParameters().map(({ key, label }) =>
      element("option", { value: key, selected: key === axis.name }, label),
    ),
  );
  choice.addEventListener("change", () => {
    const item = parameterOf(choice.value);
    Object.assign(axis, { name: item.key, low: item.low, high: item.high });
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

/** Follow a sweep until it has ended or the panel shows something else. */
async function followSweep(id) {
  followedId = id;
  let points = [];
  let next = 0;
  while (followedId === id) {
    try {
      const [whole, more] = await Promise.all([
        get(`/sweeps/${id}`),
        get(`/sweeps/${id}/points?after=${next}`),
      ]);
      if (followedId !== id) return;
      points = points.concat(more.points);
      next = more.next;
      const seen = new Map(points.map((point) => [point.number, point]));
      draw(id, whole, [...seen.values()]);
      const ended = !whole.job || !["queued", "running"].includes(whole.job.state);
      if (ended && !more.points.length) return;
    } catch (problem) {
      fill(box, errorCard(problem), backButton());
      return;
    }
    await new Promise((done) => setTimeout(done, PAUSE));
  }
}

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

function draw(id, { job, request, summary }, points) {
  const running = job && ["queued", "running"].includes(job.state);
  const stop = element(
    "button",
    {
      class: "button",
      type: "button",
      onclick: async () => {
        stop.disabled = true;
        await post(`/sweeps/${id}/cancel`).catch(() => {});
      },
    },
    "Stop",
  );
  const swept = points.filter(({ kind }) => kind !== "stated");
  const stated = points.find(({ kind }) => kind === "stated")?.error ?? null;
  const best = swept
    .filter(({ error }) => error !== null)
    .reduce((one, other) => (one && one.error <= other.error ? one : other), null);
  const drawn = (request?.parameters ?? []).map(({ parameter: name, low, high }) => ({
    name,
    low,
    high,
    log: low > 0 && high / low > 30,
    label: readableName(name.split(".")[1]),
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
    element("h1", { class: "verdict" }, sentence(best, stated, drawn, running)),
    running
      ? element(
          "div",
          {},
          element(
            "div",
            { class: "sweep-progress" },
            element("i", { style: { width: `${100 * job.fraction}%` } }),
          ),
          element("p", { class: "gain-note" }, job.text),
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
          {},
          sweepPlot(drawn, swept, stated, best?.number),
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
            drawn.length > 2 ? element("span", {}, "thick: the best") : null,
            failed.length
              ? element("span", { "data-failures": failed.length }, `✕ ${failed.length} failed`)
              : null,
          ),
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

function formatValue(name, value) {
  const [factor, unit] = unitOf(name);
  return `${+(value * factor).toPrecision(3)}${unit ? ` ${unit}` : ""}`;
}

function sentence(best, stated, drawn, running) {
  if (!best) return running ? "Reading the clouds …" : "No point has an error.";
  const where = drawn
    .map(({ name, label }) => `${label} ${formatValue(name, best.values[name])}`)
    .join(", ");
  return `Least error ${formatError(best.error)} at ${where}${stated === null ? "" : `; ${formatError(stated)} as stated`}.`;
}

const directionCard = ({ name, flat, change, low, high }) =>
  element(
    "div",
    { class: "note-card", "data-direction": name, "data-flat": String(flat) },
    element(
      "strong",
      {},
      `${capitalise(readableName(name.split(".")[0]))}: ${flat ? "flat" : flat === null ? "unknown" : "matters"}`,
    ),
    flat
      ? "The error does not change along it beyond what drawing the pushes anew changes: these clouds cannot tell it. "
      : flat === null
        ? "Only one push was compared, so nobody knows what chance does; take more sequences or clouds. "
        : "",
    `From best to worst the error changes by ${changed(change)} (95 % interval ${changed(low)} to ${changed(high)}).`,
  );
