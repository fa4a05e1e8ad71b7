// What if: causes switched on and off and moved by sliders; the shown frame is solved again at once.
import { get, post, remove, toast } from "./api.js";
import { sliderRange, toPosition, fromPosition } from "./slider-scale.js";
import { element, fill } from "./dom.js";
import { capitalise, formatMm, UNITS, readableName } from "./format.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { pageId } from "./scene.js";
import { subscribe, set, state } from "./store.js";

const KEY = "palpate.whatif";
let box = null;
let catalogue = null;
let sequenceModel = null; // {key, model, beginnings} of the run and sequence that are shown
let rows = []; // {effect, on, parameters}
let tuned = true;
let undoStack = [];
let previousView = null; // what the scene showed before this panel came to the front
let busy = false;
let stale = false;
let answer = null;

export function start() {
  box = addPanel("whatif", "What if", open, leave);
  box.addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "z" && undoStack.length) {
      event.preventDefault();
      undo();
    }
  });
  subscribe(["run", "sequence"], () => {
    if (openedPanel() === "whatif") open();
  });
  subscribe(["frame", "playing"], () => {
    if (openedPanel() === "whatif" && sequenceModel && !state().playing) solve();
  });
}

async function open() {
  const { run, sequence, layers, colour, heading } = state();
  if (!run || !sequence) {
    fill(
      box,
      mutedText(
        "Choose a diagnosis on the left; here you then try its causes on the frame that is shown.",
      ),
    );
    return;
  }
  if (!heading?.has_clouds) {
    fill(
      box,
      mutedText(
        "The dataset of this diagnosis is not where it was, so that there is nothing to compare with.",
      ),
    );
    return;
  }
  previousView ??= { layers, colour };
  set({
    layers: layers.includes("extended") ? layers : [...layers, "extended"],
    colour: "extended",
    trial: true,
  });
  const key = `${run}/${sequence}`;
  if (sequenceModel?.key === key) {
    draw();
    solve();
    return;
  }
  sequenceModel = null;
  fill(box, mutedText("Reading the dataset again, so that frames can be solved …"));
  try {
    catalogue ??= await get("/effects");
    const found = await get(sequencePath("whatif"));
    if (`${state().run}/${state().sequence}` !== key) return;
    const same = storedRows(run);
    sequenceModel = { key, ...found };
    rows = same?.rows ?? diagnosedRows();
    tuned = same?.tuned ?? true;
    undoStack = [];
    draw();
    solve();
  } catch (problem) {
    fill(
      box,
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "This cannot be tried"),
        problem.message,
      ),
    );
  }
}

function leave() {
  if (previousView) set(previousView);
  previousView = null;
  if (answer) remove(`/sessions/${pageId()}/whatif`).catch(() => {}); // a page that was never shown has nothing to go back to
  answer = null;
  set({ trial: false });
}

const mutedText = (text) => element("p", { class: "muted" }, text);

const sequencePath = (verb) =>
  `/runs/${encodeURIComponent(state().run)}/sequences/${encodeURIComponent(state().sequence)}/${verb}`;

const diagnosedRows = () =>
  sequenceModel.model.map(({ effect, parameters }) => ({
    effect,
    on: true,
    parameters: { ...parameters },
  }));

function storedRows(run) {
  try {
    const kept = JSON.parse(sessionStorage.getItem(KEY));
    return kept?.run === run ? kept : null;
  } catch {
    return null;
  }
}

/** Change something: `act` moves rows; what was before can be undone. A slider that is dragged is one change. */
function applyChange(act, whole = true) {
  const before = JSON.stringify({ rows, tuned });
  if (whole) undoStack.push(before);
  act();
  sessionStorage.setItem(KEY, JSON.stringify({ run: state().run, rows, tuned }));
  if (whole) draw();
  solve();
}

function undo() {
  const before = JSON.parse(undoStack.pop());
  rows = before.rows;
  tuned = before.tuned;
  sessionStorage.setItem(KEY, JSON.stringify({ run: state().run, rows, tuned }));
  draw();
  solve();
}

/** Solve the shown frame; while one is being solved only the newest wish is kept. */
async function solve() {
  if (busy) {
    stale = true;
    return;
  }
  busy = true;
  stale = false;
  const { frame } = state();
  const waiting = setTimeout(() => {
    answer = { ...answer, waiting: true };
    drawAnswer();
  }, 400);
  try {
    const effects = rows
      .filter((row) => row.on)
      .map(({ effect, parameters }) => ({ effect, parameters }));
    answer = await post(sequencePath("whatif"), { frame, effects, tuned, page: pageId() });
  } catch (problem) {
    answer = { problem };
  }
  clearTimeout(waiting);
  busy = false;
  if (openedPanel() !== "whatif") {
    leave();
    return;
  }
  drawAnswer();
  if (stale) solve();
}

function draw() {
  const changed = JSON.stringify(rows) !== JSON.stringify(diagnosedRows()) || !tuned;
  const absent = catalogue.filter(
    ({ name }) =>
      sequenceModel.beginnings.some(({ effect }) => effect === name) &&
      !rows.some(({ effect }) => effect === name),
  );
  fill(
    box,
    element("h1", { class: "verdict" }, "What if …"),
    element(
      "p",
      { class: "gain-note" },
      "Switch causes on and off and move them: the frame that is shown is solved again, and takes the place of the extended model in the scene.",
    ),
    element("div", { id: "whatif-answer" }),
    rows.map(causeCard),
    element(
      "label",
      { class: "whatif-switch" },
      switchInput(tuned, () =>
        applyChange(() => {
          tuned = !tuned;
        }),
      ),
      "Registration as the diagnosis fitted it",
    ),
    element(
      "div",
      { class: "actions" },
      element(
        "select",
        { "aria-label": "Add a cause", onchange: (event) => addCause(event.target.value) },
        element("option", { value: "" }, "Add a cause …"),
        absent.map(({ name, summary }) =>
          element("option", { value: name, title: summary }, capitalise(readableName(name))),
        ),
      ),
      element(
        "button",
        {
          class: "button",
          type: "button",
          disabled: !undoStack.length,
          title: "Ctrl+Z",
          onclick: undo,
        },
        "Undo",
      ),
      element(
        "button",
        {
          class: "button",
          type: "button",
          title: "Every frame of this sequence with these causes in the stated setup, as a job",
          onclick: replayAll,
        },
        "Replay the sequence",
      ),
      element(
        "button",
        {
          class: "button",
          type: "button",
          disabled: !changed,
          onclick: () =>
            applyChange(() => {
              rows = diagnosedRows();
              tuned = true;
            }),
        },
        "As diagnosed",
      ),
    ),
  );
  drawAnswer();
}

/** The shown sequence, all of it, with these causes: a run of its own among the diagnoses when it is done. */
async function replayAll({ currentTarget }) {
  currentTarget.disabled = true;
  const { heading, sequence } = state();
  const effects = rows
    .filter((row) => row.on)
    .map(({ effect, parameters }) => ({ effect, parameters }));
  try {
    await post("/replays", { dataset: heading.folder, sequences: [sequence], effects });
    openPanel("jobs");
  } catch (problem) {
    toast(problem);
  }
  currentTarget.disabled = false;
}

const switchInput = (checked, act) =>
  element("input", { type: "checkbox", role: "switch", checked, onchange: act });

function causeCard(row) {
  const effect = catalogue.find(({ name }) => name === row.effect);
  const beginning =
    sequenceModel.model.find((one) => one.effect === row.effect) ??
    sequenceModel.beginnings.find((one) => one.effect === row.effect);
  const own = sequenceModel.model.some((one) => one.effect === row.effect);
  return element(
    "fieldset",
    { class: row.on ? "whatif-card" : "whatif-card off", "data-effect": row.effect },
    element(
      "legend",
      {},
      element(
        "label",
        { class: "whatif-switch", title: effect.summary },
        switchInput(row.on, () =>
          applyChange(() => {
            row.on = !row.on;
          }),
        ),
        capitalise(readableName(row.effect)),
      ),
      own
        ? null
        : element(
            "button",
            {
              class: "link",
              type: "button",
              "aria-label": `Take ${readableName(row.effect)} away`,
              onclick: () =>
                applyChange(() => {
                  rows = rows.filter((other) => other !== row);
                }),
            },
            "take away",
          ),
    ),
    effect.parameters.map((item) =>
      item.choices.length
        ? choiceField(row, item)
        : sliderField(row, item, beginning.parameters[item.name]),
    ),
  );
}

function choiceField(row, item) {
  return element(
    "label",
    { class: "whatif-parameter" },
    element("span", {}, readableName(item.name)),
    element(
      "select",
      {
        disabled: !row.on,
        onchange: (event) =>
          applyChange(() => {
            row.parameters[item.name] = event.target.value;
          }),
      },
      item.choices.map((word) =>
        element("option", { value: word, selected: word === row.parameters[item.name] }, word),
      ),
    ),
  );
}

function sliderField(row, item, beginning) {
  const span = sliderRange(item, beginning);
  const [factor, unit] = UNITS[item.unit] ?? [1, item.unit];
  const shown = () => Number((row.parameters[item.name] * factor).toPrecision(4));
  const label = `${capitalise(readableName(row.effect))}: ${readableName(item.name)}`;
  const bar = element("input", {
    type: "range",
    min: 0,
    max: 1000,
    step: 1,
    value: toPosition(item, span, row.parameters[item.name]),
    disabled: !row.on,
    "aria-label": label,
  });
  const number = element("input", {
    type: "number",
    step: "any",
    value: shown(),
    disabled: !row.on,
    "aria-label": `${label}${unit ? ` in ${unit}` : ""}`,
  });
  let begun = false;
  bar.addEventListener("input", () => {
    if (!begun) {
      undoStack.push(JSON.stringify({ rows, tuned }));
      begun = true;
    }
    applyChange(() => {
      row.parameters[item.name] = fromPosition(item, span, +bar.value);
    }, false);
    number.value = shown();
  });
  bar.addEventListener("change", () => {
    begun = false;
    draw();
    refocus(label);
  });
  number.addEventListener("change", () => {
    const value = +number.value / factor;
    if (number.value === "" || value < (item.low ?? -Infinity) || value > (item.high ?? Infinity)) {
      number.setCustomValidity(
        `${readableName(item.name)} lies between ${boundsText(item, factor, unit)}`,
      );
      number.reportValidity();
      return;
    }
    applyChange(() => {
      row.parameters[item.name] = value;
    });
  });
  return element(
    "div",
    { class: "whatif-parameter" },
    element("span", {}, readableName(item.name)),
    bar,
    number,
    element("span", { class: "unit" }, unit),
  );
}

const boundsText = ({ low, high }, factor, unit) =>
  `${low === null ? "−∞" : low * factor} and ${high === null ? "∞" : high * factor}${unit ? ` ${unit}` : ""}`;

const refocus = (label) =>
  [...box.querySelectorAll("input[type=range]")]
    .find((bar) => bar.getAttribute("aria-label") === label)
    ?.focus();

function addCause(name) {
  const beginning = sequenceModel.beginnings.find(({ effect }) => effect === name);
  if (beginning)
    applyChange(() => {
      rows = [...rows, { effect: name, on: true, parameters: { ...beginning.parameters } }];
    });
}

function drawAnswer() {
  if (!document.getElementById("whatif-answer")) return;
  if (answer?.problem) {
    fill(
      "whatif-answer",
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "Not solved"),
        answer.problem.message,
      ),
    );
    return;
  }
  if (typeof answer?.distance !== "number" && !answer?.outcome) {
    fill("whatif-answer", mutedText("Solving …"));
    return;
  }
  const {
    distance,
    distance_raw: raw,
    distance_extended: extended,
    noise_floor: floor,
    converged,
    outcome,
    waiting,
  } = answer;
  const steps = [
    ["Raw model", raw, "raw"],
    ["Extended", extended, "extended"],
    ["What if", distance, "corrected"],
    ["Noise floor", floor, "floor"],
  ];
  const most = Math.max(...steps.map(([, value]) => value ?? 0)) || 1;
  fill(
    "whatif-answer",
    element(
      "section",
      {},
      element("h2", {}, "Error in this frame", element("small", {}, waiting ? "solving …" : "RMS")),
      element(
        "div",
        { class: "ladder" },
        steps.flatMap(([label, value, thing]) => [
          element("span", {}, label),
          element(
            "div",
            { class: "bar" },
            element("i", {
              style: { width: `${(100 * (value ?? 0)) / most}%`, background: `var(--${thing})` },
            }),
          ),
          element("span", { class: "bar-value", "data-model": thing }, formatMm(value)),
        ]),
      ),
      converged
        ? null
        : element(
            "div",
            { class: "note-card bad" },
            element("strong", {}, "No equilibrium"),
            `${capitalise(outcome)}.`,
          ),
    ),
  );
}
