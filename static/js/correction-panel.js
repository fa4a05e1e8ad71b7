// The panel of the correction network: train it on a model, watch it learn, and see what it is worth beside naming the cause.
import { get, post, errorTitle } from "./api.js";
import { validationCurve, ladderChart } from "./correction-plots.js";
import { element, fill } from "./dom.js";
import { capitalise } from "./format.js";
import { onJobsDone, addResultOpener } from "./jobs.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { subscribe, state } from "./store.js";

const KINDS = [
  ["unet2d", "2D U-Net, top layer"],
  ["unet3d", "3D U-Net, volume"],
  ["graph", "Graph network, mesh"],
];
const PAUSE = 900;
let box = null;
let settings = {
  dataset: null,
  run: "",
  kind: "unet2d",
  trust: 0.5,
  hold: 1,
  epochs: 40,
  every: 1,
};
let followed = null; // {kind: "trainings" | "evaluations", id}
let generation = 0;

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

function show(kind, id) {
  followed = { kind, id };
  openPanel("correction");
}

const errorCard = (problem) =>
  element(
    "div",
    { class: "note-card bad", role: "alert" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );
const isOpen = (job) => job && ["queued", "running"].includes(job.state);

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

/** The form, what there is, and the newest ladder. */
async function drawAll(mine) {
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
          `A network learns from clouds. Put a dataset folder into ${folder} and open this panel again.`,
        ),
      ),
    );
    return false;
  }
  const current = runs.find(({ id }) => id === state().run);
  if (!datasets.includes(settings.dataset))
    settings = {
      ...settings,
      dataset: datasets.includes(current?.folder) ? current.folder : datasets[0],
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
      newest?.summary.sentence ?? "What can a network learn of the error that the model leaves?",
    ),
    newest ? ladderChart(newest.summary) : null,
    form(datasets, models),
    list("Trainings", "trainings", trainings),
    list("Ladders", "evaluations", evaluations),
  );
  return false;
}

function form(datasets, models) {
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
        datasets.map((name) => [name, name]),
      ),
    ),
    element(
      "label",
      {},
      "On top of",
      select("run", [
        ["", "the stated model"],
        ...models.map(({ id }) => [id, `the extended model of ${id}`]),
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

function list(heading, kind, entries) {
  if (!entries.length) return null;
  return element(
    "section",
    {},
    element("h2", {}, heading),
    element(
      "div",
      { class: "sweep-list" },
      entries.slice(0, 8).map(({ id, job, summary }) =>
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
            summary?.validation_error_mm
              ? `${summary.validation_error_mm.toFixed(3)} mm`
              : (job?.state ?? "on disk"),
          ),
        ),
      ),
    ),
  );
}

/** One training or evaluation; whether it goes on. */
async function drawOne(mine) {
  const { kind, id } = followed;
  const whole = await get(`/${kind}/${encodeURIComponent(id)}`);
  if (mine !== generation) return false;
  const { job } = whole;
  const say =
    (path) =>
    async ({ currentTarget }) => {
      currentTarget.disabled = true;
      await post(path).catch((problem) => box.append(errorCard(problem)));
      followPanel();
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
      kind === "trainings"
        ? trainingSentence(whole)
        : (whole.summary?.sentence ?? "Measuring the test sequences …"),
    ),
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
    whole.history?.length
      ? element(
          "section",
          {},
          element("h2", {}, "Validation by epoch"),
          validationCurve(whole.history, whole.summary?.validation_error_without_mm),
        )
      : null,
    kind === "evaluations" && whole.summary
      ? [
          ladderChart(whole.summary),
          element(
            "p",
            { class: "gain-note" },
            "Of the moving part, which leaves out what is as wrong in the untouched block, the file on disk has the same shares, and the paper's mean distance.",
          ),
        ]
      : null,
    element(
      "div",
      { class: "actions" },
      isOpen(job)
        ? element(
            "button",
            { class: "button", type: "button", onclick: say(`/${kind}/${id}/cancel`) },
            "Stop",
          )
        : null,
      job?.can_retry
        ? element(
            "button",
            { class: "button", type: "button", onclick: say(`/jobs/${id}/retry`) },
            kind === "trainings" ? "Go on" : "Retry",
          )
        : null,
      kind === "trainings" && whole.summary
        ? element(
            "button",
            {
              class: "button strong",
              type: "button",
              onclick: () =>
                requestJob(
                  "evaluations",
                  { dataset: whole.summary.folder, run: whole.request?.run ?? null },
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

function trainingSentence({ job, history, summary }) {
  if (summary) {
    const [before, after] = [summary.validation_error_without_mm, summary.validation_error_mm];
    return `In validation the mean distance is ${after.toFixed(2)} mm with the network, ${before.toFixed(2)} mm without.`;
  }
  if (!history.length)
    return isOpen(job) ? "Replaying what the network learns from …" : "Nothing was learned yet.";
  return `After ${history.length} epochs the mean distance in validation is ${Math.min(...history.map(([, error]) => error)).toFixed(2)} mm.`;
}
