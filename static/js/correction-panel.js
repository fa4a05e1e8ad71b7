// The panel of the correction network: trains it on a model, shows the training, and compares
// models with and without networks on the test sequences (the ladder).
import { errorCard, get, post, toast } from "./api.js";
import { validationCurve, ladderChart } from "./correction-plots.js";
import { changedDataNote, element, fill } from "./dom.js";
import { capitalise } from "./format.js";
import { onJobsDone, addResultOpener } from "./jobs.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { subscribe, state } from "./store.js";

/** @import { Evaluation, Job, RunEntry, Training } from "./types.js" */

/** @type {[string, string][]} */
const KINDS = [
  ["unet2d", "2D U-Net, over the top"],
  ["unet3d", "3D U-Net, volume"],
  ["graph", "Graph network, mesh"],
];
const PAUSE = 900; // between requests while a job runs [ms]
/** @typedef {"trainings" | "evaluations"} JobKind */
/**
 * What the form is set to; `run` is empty for the stated model.
 * @typedef {object} Settings
 * @property {string} dataset
 * @property {string} run
 * @property {string} kind
 * @property {number} trust largest correction [voxels]
 * @property {number} hold weight that holds the hidden part [1/mm]
 * @property {number} epochs
 * @property {number} every one of so many clouds is used
 */
/** @type {HTMLElement} */
let box;
/** @type {Settings} */
let settings = { dataset: "", run: "", kind: "unet2d", trust: 0.5, hold: 1, epochs: 40, every: 1 };
/** @type {{ kind: JobKind, id: string } | null} */
let followed = null; // the job that is shown; null while the form is
/** @type {{ attempt: string, node: HTMLElement } | null} */
let stopButton = null; // of the shown job's attempt
let generation = 0; // increases whenever the panel starts to show something else

/**
 * Add the panel.
 * @param {() => void} refresh called when a training has added a model to a run
 */
export function start(refresh) {
  box = addPanel("correction", "Correction", followPanel, () => {
    generation += 1;
  });
  addResultOpener("training", "Open the training", (id) => show("trainings", id));
  addResultOpener("evaluation", "Open the ladder", (id) => show("evaluations", id));
  onJobsDone((jobs) => {
    if (jobs.some(({ kind, result }) => kind === "training" && result)) refresh();
  });
  subscribe(["run"], () => {
    if (openedPanel() === "correction" && !followed) followPanel();
  });
}

/**
 * @param {JobKind} kind
 * @param {string} id
 */
function show(kind, id) {
  followed = { kind, id };
  openPanel("correction");
}

/**
 * @param {Job | null} job
 * @returns {job is Job}
 */
const isOpen = (job) => job !== null && ["queued", "running"].includes(job.state);

/** Draw the panel, and again while the job that is shown runs. */
async function followPanel() {
  const mine = ++generation;
  while (mine === generation && openedPanel() === "correction") {
    let again = false;
    try {
      again = followed ? await drawOne(mine) : await drawAll(mine);
    } catch (problem) {
      if (mine === generation) fill(box, errorCard(problem), backButton());
    }
    if (!again) return;
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
        followed = null;
        followPanel();
      },
    },
    "All of them",
  );

/**
 * Draw the form, the trainings and evaluations, and the newest ladder.
 * @param {number} mine generation that this call draws for
 * @returns {Promise<boolean>}
 */
async function drawAll(mine) {
  /** @type {[{ datasets: string[], folder: string }, RunEntry[], Training[], Evaluation[]]} */
  const [{ datasets, folder }, runs, trainings, evaluations] = await Promise.all([
    get("/datasets"),
    get("/runs"),
    get("/trainings"),
    get("/evaluations"),
  ]);
  if (mine !== generation) return false;
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
          "A network learns from clouds. " +
            `Put a dataset folder into ${folder} and open this panel again.`,
        ),
      ),
    );
    return false;
  }
  const current = runs.find(({ id }) => id === state().run);
  if (!datasets.includes(settings.dataset))
    settings = {
      ...settings,
      dataset: datasets.find((name) => name === current?.folder) ?? datasets[0],
      run: "",
    };
  const models = runs.filter(
    ({ folder: own, causes }) => own === settings.dataset && causes?.length,
  );
  const newest = evaluations.find(({ summary }) => summary?.folder === settings.dataset);
  fill(
    box,
    element("div", { class: "eyebrow" }, "Correction"),
    element(
      "h1",
      { class: "verdict" },
      newest?.summary?.sentence ?? "What can a network learn of the error that the model leaves?",
    ),
    changedDataNote(newest),
    newest?.summary ? ladderChart(newest.summary) : null,
    form(datasets, models),
    list("Trainings", "trainings", trainings),
    list("Ladders", "evaluations", evaluations),
  );
  return false;
}

/**
 * @param {string[]} datasets
 * @param {RunEntry[]} models
 * @returns {HTMLElement}
 */
function form(datasets, models) {
  /**
   * @param {"dataset" | "run" | "kind"} name
   * @param {[string, string][]} entries
   * @returns {HTMLSelectElement}
   */
  const select = (name, entries) => {
    const node = element(
      "select",
      { name },
      entries.map(([value, label]) =>
        element("option", { value, selected: String(settings[name]) === value }, label),
      ),
    );
    node.addEventListener("change", () => {
      settings[name] = node.value;
      if (name === "dataset") {
        settings.run = "";
        followPanel();
      }
    });
    return node;
  };
  /**
   * @param {"trust" | "hold" | "epochs" | "every"} name
   * @param {string} label
   * @param {number} low
   * @param {number} high
   * @param {number} [step]
   * @returns {HTMLElement}
   */
  const number = (name, label, low, high, step = 1) => {
    const field = element("input", {
      name,
      type: "number",
      value: settings[name],
      min: low,
      max: high,
      step,
      required: true,
    });
    field.addEventListener("change", () => {
      settings[name] = +field.value;
    });
    return element("label", {}, label, field);
  };
  /** @type {HTMLElement} */
  const whole = element(
    "form",
    {
      class: "sweep-form",
      onsubmit: async (event) => {
        event.preventDefault();
        const { dataset, run, ...rest } = settings;
        await requestJob("trainings", { dataset, run: run || null, ...rest }, whole);
      },
    },
    element(
      "label",
      {},
      "Dataset",
      select(
        "dataset",
        datasets.map((name) => /** @type {[string, string]} */ ([name, name])),
      ),
    ),
    element(
      "label",
      {},
      "On top of",
      select("run", [
        ["", "the stated model"],
        ...models.map(
          ({ id }) => /** @type {[string, string]} */ ([id, `the extended model of ${id}`]),
        ),
      ]),
    ),
    element("label", {}, "Network", select("kind", KINDS)),
    element(
      "details",
      {},
      element("summary", {}, "More"),
      element(
        "div",
        { class: "pair" },
        number("epochs", "Epochs at most", 1, 100000),
        number("every", "One of so many clouds", 1, 10000),
        number("trust", "Correction, voxels at most", 0.05, 10, 0.05),
        number("hold", "Weight that holds the hidden, 1/mm", 0, 1000, 0.1),
      ),
    ),
    element(
      "div",
      { class: "actions" },
      element("button", { class: "button strong", type: "submit" }, "Train"),
      element(
        "button",
        {
          class: "button",
          type: "button",
          title: "Compares models and their newest networks on the test sequences",
          onclick: () =>
            requestJob(
              "evaluations",
              { dataset: settings.dataset, run: settings.run || null },
              whole,
            ),
        },
        "Measure the ladder",
      ),
    ),
  );
  return whole;
}

/**
 * Start a job and show it; errors are shown in the form.
 * @param {JobKind} kind
 * @param {object} body
 * @param {HTMLElement} near element with the buttons to disable
 */
async function requestJob(kind, body, near) {
  for (const button of near.querySelectorAll("button")) button.disabled = true;
  try {
    followed = { kind, id: (await post(`/${kind}`, body)).id };
    followPanel();
  } catch (problem) {
    for (const button of near.querySelectorAll("button")) button.disabled = false;
    near.querySelector(".note-card")?.remove();
    near.append(errorCard(problem));
  }
}

/**
 * @param {string} heading
 * @param {JobKind} kind
 * @param {(Training | Evaluation)[]} entries
 * @returns {HTMLElement | null}
 */
function list(heading, kind, entries) {
  if (!entries.length) return null;
  return element(
    "section",
    {},
    element("h2", {}, heading),
    element(
      "div",
      { class: "sweep-list" },
      entries.slice(0, 8).map(({ id, job, summary, data_changed: changed }) =>
        element(
          "button",
          {
            type: "button",
            [`data-${kind}`]: id,
            onclick: () => {
              followed = { kind, id };
              followPanel();
            },
          },
          element("span", {}, id),
          element(
            "span",
            { class: "muted" },
            summary && "validation_error_mm" in summary
              ? `${summary.validation_error_mm.toFixed(3)} mm`
              : (job?.state ?? "on disk"),
            changed ? " · data changed since" : null,
          ),
        ),
      ),
    ),
  );
}

/**
 * Draw a training or evaluation; return whether it still runs.
 * @param {number} mine generation that this call draws for
 * @returns {Promise<boolean>}
 */
async function drawOne(mine) {
  if (!followed) return false;
  const { kind, id } = followed;
  /** @type {Training | Evaluation} */
  const entry = await get(`/${kind}/${encodeURIComponent(id)}`);
  if (mine !== generation) return false;
  const { job } = entry;
  const training = "history" in entry ? entry : null;
  const evaluation = "history" in entry ? null : entry;
  /**
   * @param {string} path
   * @returns {(event: { currentTarget: HTMLButtonElement }) => Promise<void>}
   */
  const request =
    (path) =>
    async ({ currentTarget: button }) => {
      button.disabled = true;
      try {
        await post(path);
      } catch (problem) {
        toast(problem);
        button.disabled = false;
      }
      followPanel();
    };
  // The same button each time, because one that is replaced while it is pressed does not act.
  const attempt = `${id} ${job?.attempt}`;
  if (stopButton?.attempt !== attempt)
    stopButton = {
      attempt,
      node: element(
        "button",
        { class: "button", type: "button", onclick: request(`/${kind}/${id}/cancel`) },
        "Stop",
      ),
    };
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
    element(
      "h1",
      { class: "verdict" },
      training
        ? trainingSentence(training)
        : (evaluation?.summary?.sentence ?? "Measuring the test sequences …"),
    ),
    changedDataNote(training ?? evaluation),
    isOpen(job)
      ? element(
          "div",
          {},
          element(
            "div",
            { class: "sweep-progress" },
            element("i", { style: { width: `${100 * job.fraction}%` } }),
          ),
          element("p", { class: "gain-note" }, capitalise(job.text)),
        )
      : null,
    job?.error ? errorCard(job.error) : null,
    training?.history.length
      ? element(
          "section",
          {},
          element("h2", {}, "Validation by epoch"),
          validationCurve(training.history, training.summary?.validation_error_without_mm),
        )
      : null,
    evaluation?.summary
      ? [
          ladderChart(evaluation.summary),
          element(
            "p",
            { class: "gain-note" },
            "Of the moving part, which leaves out what is as wrong in the untouched phantom, " +
              "the file on disk has the same shares, and the paper's mean distance.",
          ),
        ]
      : null,
    element(
      "div",
      { class: "actions" },
      isOpen(job) ? stopButton.node : null,
      job?.can_retry
        ? element(
            "button",
            { class: "button", type: "button", onclick: request(`/jobs/${id}/retry`) },
            kind === "trainings" ? "Go on" : "Retry",
          )
        : null,
      training?.summary
        ? element(
            "button",
            {
              class: "button strong",
              type: "button",
              onclick: () =>
                requestJob(
                  "evaluations",
                  { dataset: training.summary?.folder, run: training.request?.run ?? null },
                  box,
                ),
            },
            "Measure the ladder",
          )
        : null,
      backButton(),
    ),
  );
  return isOpen(job);
}

/**
 * @param {Training} training
 * @returns {string}
 */
function trainingSentence({ job, history, summary }) {
  if (summary) {
    const [before, after] = [summary.validation_error_without_mm, summary.validation_error_mm];
    const [reached, without] = [after, before].map((error) => `${error.toFixed(2)} mm`);
    return `In validation the mean distance is ${reached} with the network, ${without} without.`;
  }
  if (!history.length)
    return isOpen(job) ? "Replaying what the network learns from …" : "Nothing was learned yet.";
  const least = Math.min(...history.map(([, error]) => error)).toFixed(2);
  return `After ${history.length} epochs the mean distance in validation is ${least} mm.`;
}
