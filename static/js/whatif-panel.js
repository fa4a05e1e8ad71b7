// The panel "What if": causes are switched on and off and moved by sliders; the shown frame is
// solved again.
import { get, post, remove, toast, toError } from "./api.js";
import { sliderRange, toPosition, fromPosition } from "./slider-scale.js";
import { element, fill } from "./dom.js";
import { capitalise, formatMm, UNITS, readableName } from "./format.js";
import { addPanel, openedPanel, openPanel } from "./panels.js";
import { pageId } from "./scene.js";
import { subscribe, set, state } from "./store.js";

/** @import { Effect, EffectValues, Parameter, WhatIfAnswer, WhatIfChoices } from "./types.js" */
/** @import { WhatIfRow } from "./types.js" */

const KEY = "palpate.whatif";
/** @type {HTMLElement} */
let box;
/** @type {Effect[] | null} */
let catalogue = null;

/**
 * The diagnosed effects of the run, and initial values of all effects for the shown sequence.
 * @type {({ key: string } & WhatIfChoices) | null}
 */
let sequenceModel = null;
/** @type {WhatIfRow[]} */
let rows = [];
let tuned = true; // the registration is as the diagnosis fitted it
/** @type {string[]} */
let undoStack = []; // earlier rows as JSON
/** @type {{ layers: string[], colour: string } | null} */
let previousView = null; // what the scene showed before the panel came to the front
let busy = false;
let stale = false; // the rows have changed since the last request
/** @type {WhatIfAnswer | null} */
let answer = null;

/** Add the panel. */
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

/** Load what the sequence needs, draw the panel and solve the frame. */
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
        "The dataset of this diagnosis is not where it was, so that there is nothing to " +
          "compare with.",
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
    const stored = storedRows(run);
    sequenceModel = { key, ...found };
    rows = stored?.rows ?? diagnosedRows();
    tuned = stored?.tuned ?? true;
    undoStack = [];
    draw();
    solve();
  } catch (error) {
    fill(
      box,
      element(
        "div",
        { class: "note-card bad" },
        element("strong", {}, "This cannot be tried"),
        toError(error).message,
      ),
    );
  }
}

/** Show what the scene showed before. */
function leave() {
  if (previousView) set(previousView);
  previousView = null;
  // Without an answer the server shows nothing that would have to be taken back.
  if (answer) remove(`/sessions/${pageId()}/whatif`).catch(() => {});
  answer = null;
  set({ trial: false });
}

/**
 * @param {string} text
 * @returns {HTMLElement}
 */
const mutedText = (text) => element("p", { class: "muted" }, text);

/**
 * Return the API's path of the shown sequence.
 * @param {string} verb
 * @returns {string}
 */
const sequencePath = (verb) => {
  const [run, sequence] = [state().run ?? "", state().sequence ?? ""].map(encodeURIComponent);
  return `/runs/${run}/sequences/${sequence}/${verb}`;
};

/**
 * Return the causes as the diagnosis found them.
 * @returns {WhatIfRow[]}
 */
const diagnosedRows = () =>
  (sequenceModel?.model ?? []).map(({ effect, parameters }) => ({
    effect,
    on: true,
    parameters: { ...parameters },
  }));

/**
 * Return what was set for a run before the page was reloaded.
 * @param {string} run
 * @returns {{ rows: WhatIfRow[], tuned: boolean } | null}
 */
function storedRows(run) {
  try {
    const stored = JSON.parse(sessionStorage.getItem(KEY) ?? "null");
    return stored?.run === run ? stored : null;
  } catch {
    return null;
  }
}

/**
 * Apply a change, store it and solve the frame. A `whole` change can be undone; the steps of a
 * dragged slider are not whole.
 * @param {() => void} act
 * @param {boolean} [whole]
 */
function applyChange(act, whole = true) {
  const before = JSON.stringify({ rows, tuned });
  if (whole) undoStack.push(before);
  act();
  sessionStorage.setItem(KEY, JSON.stringify({ run: state().run, rows, tuned }));
  if (whole) draw();
  solve();
}

/** Take the last change back. */
function undo() {
  const last = undoStack.pop();
  if (!last) return;
  const before = JSON.parse(last);
  rows = before.rows;
  tuned = before.tuned;
  sessionStorage.setItem(KEY, JSON.stringify({ run: state().run, rows, tuned }));
  draw();
  solve();
}

/** Solve the shown frame; while one is being solved only the newest request is kept. */
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
    answer = { problem: toError(problem) };
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

/** Draw the panel. */
function draw() {
  const changed = JSON.stringify(rows) !== JSON.stringify(diagnosedRows()) || !tuned;
  const initial = sequenceModel?.beginnings ?? [];
  const absent = (catalogue ?? []).filter(
    ({ name, by_hand: byHand }) =>
      byHand &&
      initial.some(({ effect }) => effect === name) &&
      !rows.some(({ effect }) => effect === name),
  );
  fill(
    box,
    element("h1", { class: "verdict" }, "What if …"),
    element(
      "p",
      { class: "gain-note" },
      "Switch causes on and off and move them: the frame that is shown is solved again, and " +
        "takes the place of the extended model in the scene.",
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
    impossibleNote(),
  );
  drawAnswer();
}

/**
 * Say which causes this phantom cannot have, and why; null where it can have all.
 * @returns {HTMLElement | null}
 */
function impossibleNote() {
  const reasons = Object.entries(sequenceModel?.impossible ?? {}).filter(
    ([name]) => catalogue?.find((effect) => effect.name === name)?.by_hand,
  );
  if (!reasons.length) return null;
  const said = reasons.map(([name, reason]) => `${readableName(name)} (${reason})`);
  return element(
    "p",
    { class: "gain-note", id: "whatif-impossible" },
    `Not with this phantom: ${said.join("; ")}.`,
  );
}

/**
 * Start a job that replays the whole sequence with these causes; its run is then in the sidebar.
 * @param {{ currentTarget: HTMLButtonElement }} event
 */
async function replayAll({ currentTarget: button }) {
  button.disabled = true;
  const { heading, sequence } = state();
  const effects = rows
    .filter((row) => row.on)
    .map(({ effect, parameters }) => ({ effect, parameters }));
  try {
    await post("/replays", { dataset: heading?.folder, sequences: [sequence], effects });
    openPanel("jobs");
  } catch (problem) {
    toast(problem);
  }
  button.disabled = false;
}

/**
 * @param {boolean} checked
 * @param {() => void} act
 * @returns {HTMLInputElement}
 */
const switchInput = (checked, act) =>
  element("input", { type: "checkbox", role: "switch", checked, onchange: act });

/**
 * @param {WhatIfRow} row
 * @returns {HTMLElement}
 */
function causeCard(row) {
  /** @param {EffectValues} one */
  const same = (one) => one.effect === row.effect;
  const effect = catalogue?.find(({ name }) => name === row.effect);
  const diagnosed = sequenceModel?.model.find(same);
  const initial = diagnosed ?? sequenceModel?.beginnings.find(same);
  return element(
    "fieldset",
    { class: row.on ? "whatif-card" : "whatif-card off", "data-effect": row.effect },
    element(
      "legend",
      {},
      element(
        "label",
        { class: "whatif-switch", title: effect?.summary },
        switchInput(row.on, () =>
          applyChange(() => {
            row.on = !row.on;
          }),
        ),
        capitalise(readableName(row.effect)),
      ),
      diagnosed
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
    effect?.by_hand &&
      effect.parameters.map((item) =>
        item.choices.length
          ? choiceField(row, item)
          : sliderField(row, item, Number(initial?.parameters[item.name])),
      ),
  );
}

/**
 * @param {WhatIfRow} row
 * @param {Parameter} item
 * @returns {HTMLElement}
 */
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

/**
 * Create slider and number field of a parameter.
 * @param {WhatIfRow} row
 * @param {Parameter} item
 * @param {number} initial value around which the slider lies
 * @returns {HTMLElement}
 */
function sliderField(row, item, initial) {
  const span = sliderRange(withinBody(row.effect, item, initial), initial);
  const [factor, unit] = UNITS[item.unit] ?? [1, item.unit];
  const value = () => Number(row.parameters[item.name]);
  const shown = () => String(Number((value() * factor).toPrecision(4)));
  const label = `${capitalise(readableName(row.effect))}: ${readableName(item.name)}`;
  const bar = element("input", {
    type: "range",
    min: 0,
    max: 1000,
    step: 1,
    value: toPosition(item, span, value()),
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
    const typed = +number.value / factor;
    const outside = typed < (item.low ?? -Infinity) || typed > (item.high ?? Infinity);
    if (number.value === "" || outside) {
      number.setCustomValidity(
        `${readableName(item.name)} lies between ${boundsText(item, factor, unit)}`,
      );
      number.reportValidity();
      return;
    }
    applyChange(() => {
      row.parameters[item.name] = typed;
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

/**
 * Return a parameter with the bounds that the phantom sets to it, such as its extent to a place.
 * They are wider where the initial value lies outside.
 * @param {string} effect
 * @param {Parameter} item
 * @param {number} initial
 * @returns {Parameter}
 */
function withinBody(effect, item, initial) {
  const [low, high] = sequenceModel?.spans[effect]?.[item.name] ?? [item.low, item.high];
  if (low === null || high === null) return item;
  return { ...item, low: Math.min(low, initial), high: Math.max(high, initial) };
}

/**
 * @param {Parameter} item
 * @param {number} factor
 * @param {string} unit
 * @returns {string}
 */
const boundsText = ({ low, high }, factor, unit) => {
  const [least, most] = [low === null ? "−∞" : low * factor, high === null ? "∞" : high * factor];
  return `${least} and ${most}${unit ? ` ${unit}` : ""}`;
};

/**
 * Give the focus to the slider with a label.
 * @param {string} label
 */
const refocus = (label) =>
  /** @type {HTMLInputElement[]} */ ([...box.querySelectorAll("input[type=range]")])
    .find((bar) => bar.getAttribute("aria-label") === label)
    ?.focus();

/**
 * Add a cause with its initial values.
 * @param {string} name
 */
function addCause(name) {
  const initial = sequenceModel?.beginnings.find(({ effect }) => effect === name);
  if (initial)
    applyChange(() => {
      rows = [...rows, { effect: name, on: true, parameters: { ...initial.parameters } }];
    });
}

/** Draw the errors of the solved frame as bars. */
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
    notes,
    waiting,
  } = answer;
  /** @type {[string, number | null | undefined, string][]} */
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
        steps.flatMap(([label, value, name]) => [
          element("span", {}, label),
          element(
            "div",
            { class: "bar" },
            element("i", {
              style: { width: `${(100 * (value ?? 0)) / most}%`, background: `var(--${name})` },
            }),
          ),
          element("span", { class: "bar-value", "data-model": name }, formatMm(value)),
        ]),
      ),
      converged
        ? null
        : element(
            "div",
            { class: "note-card bad" },
            element("strong", {}, "No equilibrium"),
            `${capitalise(outcome ?? "")}.`,
          ),
      (notes ?? []).map((note) =>
        element(
          "div",
          { class: "note-card" },
          element("strong", {}, "Note"),
          `${capitalise(note)}.`,
        ),
      ),
    ),
  );
}
