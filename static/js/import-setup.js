// The setup of an import: a dataset.toml, or that of an existing dataset; and what the numbers of
// poses and forces mean.
import { element } from "./dom.js";
import { mappingValue, numbers, unquoted } from "./import-mapping.js";

/** @import { ImportActions, ImportView } from "./types.js" */

const AXES = ["x", "y", "z"];

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @param {HTMLElement | null} problem
 * @returns {HTMLElement | null}
 */
export function setupSection(view, actions, problem) {
  const { look, setup, datasets, job } = view;
  if (!look || look.source.kind === "dataset") return null;
  const file = element("input", {
    type: "file",
    name: "setup",
    accept: ".toml",
    "aria-label": "A dataset.toml file",
    "data-key": "setup-file",
    disabled: job !== null,
  });
  file.addEventListener("change", async () => {
    const chosen = file.files?.[0];
    if (chosen) actions.setSetup({ kind: "file", name: chosen.name, text: await chosen.text() });
  });
  return element(
    "section",
    { class: "import-step", "aria-label": "Setup" },
    element("h2", {}, "3  Setup"),
    element(
      "p",
      { class: look.setup_stated ? "import-state good" : "import-state" },
      look.setup_stated
        ? `Phantom and tool are stated${setup.kind === "none" ? "" : ` by ${setup.name}`}.`
        : "No recording states phantom, tool, landmarks and camera. Choose a dataset.toml, or " +
            "the setup of a dataset that has the same.",
    ),
    element(
      "div",
      { class: "import-pair" },
      element("label", {}, "A dataset.toml", file),
      element(
        "label",
        {},
        "or the setup of a dataset",
        element(
          "select",
          {
            name: "setup-dataset",
            "data-key": "setup-dataset",
            disabled: job !== null || !datasets.length,
            onchange: ({ target }) =>
              actions.setSetup(
                target.value
                  ? { kind: "dataset", name: target.value, text: null }
                  : { kind: "none", name: "", text: null },
              ),
          },
          element("option", { value: "" }, datasets.length ? "none" : "there is no dataset yet"),
          datasets.map((name) =>
            element(
              "option",
              { value: name, selected: setup.kind === "dataset" && setup.name === name },
              name,
            ),
          ),
        ),
      ),
    ),
    problem,
  );
}

/**
 * Return a value of import.toml as it was changed here, else as the look has it.
 * @param {ImportView} view
 * @param {string} table
 * @param {string} key
 * @returns {string | null}
 */
const current = ({ look, meaning }, table, key) =>
  meaning[`${table}.${key}`] ?? mappingValue(look?.mapping ?? null, table, key);

/**
 * Return the name of the stream that is taken in a role; "" for none.
 * @param {ImportView} view
 * @param {string} role
 * @returns {string}
 */
export const takenStream = ({ look }, role) =>
  look?.recordings.flatMap(({ streams }) => streams).find((one) => one.role === role)?.name ?? "";

/**
 * Return whether forces are taken whose frame nobody has stated.
 * @param {ImportView} view
 * @returns {boolean}
 */
export const needsForceFrame = (view) =>
  view.look?.source.kind === "recording" &&
  takenStream(view, "wrench") !== "" &&
  unquoted(current(view, "wrench", "frame")) === "";

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @param {HTMLElement | null} problem
 * @returns {HTMLElement | null}
 */
export function meaningSection(view, actions, problem) {
  const { look, meaning, job } = view;
  if (!look?.mapping || look.source.kind === "dataset") return null;
  const tip = numbers(current(view, "pose", "tool_tip"));
  const pending = Object.entries(meaning).some(([path, value]) => {
    const [table, key] = path.split(".");
    return mappingValue(look.mapping, table, key) !== value;
  });
  return element(
    "section",
    { class: "import-step", "aria-label": "Meaning of the numbers" },
    element("h2", {}, "Meaning of the numbers"),
    takenStream(view, "wrench") ? forceFields(view, actions) : null,
    element(
      "fieldset",
      { class: "import-tip" },
      element("legend", {}, "From the pose’s origin to the centre of the ball, mm"),
      AXES.map((axis, at) =>
        element(
          "label",
          {},
          axis,
          element("input", {
            type: "number",
            step: "any",
            value: +(1e3 * (tip[at] ?? 0)).toFixed(4),
            "aria-label": `Tool tip ${axis}, mm`,
            "data-key": `tip ${axis}`,
            onchange: ({ target }) => {
              const next = AXES.map((_, one) => tip[one] ?? 0);
              next[at] = (Number(target.value) || 0) / 1e3;
              actions.setMeaning("pose.tool_tip", `[${next.map(decimal).join(", ")}]`);
            },
          }),
        ),
      ),
    ),
    problem,
    pending
      ? element(
          "div",
          { class: "actions" },
          element(
            "button",
            {
              class: "button",
              type: "button",
              "data-key": "again",
              disabled: job !== null,
              onclick: actions.lookAgain,
            },
            "Look again with these",
          ),
        )
      : null,
    element(
      "details",
      { class: "import-notes" },
      element("summary", {}, "All of import.toml"),
      element("pre", { class: "import-toml", tabindex: "0" }, look.mapping),
    ),
  );
}

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function forceFields(view, actions) {
  const frame = unquoted(current(view, "wrench", "frame"));
  const open = frame === "";
  /**
   * @param {string} label
   * @param {string} key
   * @param {[string, string][]} entries TOML value and label
   * @param {boolean} [bad]
   * @returns {HTMLElement}
   */
  const select = (label, key, entries, bad = false) =>
    element(
      "label",
      {},
      label,
      element(
        "select",
        {
          name: `wrench-${key}`,
          "data-key": `wrench ${key}`,
          "aria-invalid": bad ? "true" : null,
          "aria-describedby": bad ? "force-frame-open" : null,
          onchange: ({ target }) => actions.setMeaning(`wrench.${key}`, target.value),
        },
        entries.map(([value, text]) =>
          element(
            "option",
            { value, selected: value === (current(view, "wrench", key) ?? entries[0][0]) },
            text,
          ),
        ),
      ),
    );
  return element(
    "div",
    {},
    element(
      "div",
      { class: "import-pair" },
      select(
        "Axes of the forces",
        "frame",
        [
          ...(open ? /** @type {[string, string][]} */ ([['""', "not stated"]]) : []),
          ['"robot"', "of the robot, as the poses"],
          ['"tool"', "of the tool: the sensor turns with it"],
        ],
        open,
      ),
      select("Their zero", "zero", [
        ['"none"', "as recorded"],
        ['"fitted"', "fitted before the first contact"],
      ]),
    ),
    open
      ? element(
          "p",
          { class: "import-field-problem", id: "force-frame-open" },
          "This is never guessed: state it, or take no forces.",
        )
      : null,
  );
}

/**
 * @param {number} value
 * @returns {string}
 */
const decimal = (value) => (Number.isInteger(value) ? `${value}.0` : String(+value.toFixed(7)));
