// The panel of registration by hand: pairs with their residuals and doubts, and the result of
// ICP.
import { errorCard } from "./api.js";
import { element, fill, icon } from "./dom.js";
import { capitalise, formatMm } from "./format.js";
import { completePairs } from "./register-pairs.js";
import { REGISTER_SHORTCUTS } from "./register-shortcuts.js";

/**
 * @import {
 *   Child, IcpResult, PairEditor, PointPair, RegisterActions, RegisterView, Side
 * } from "./types.js"
 */

const DEGREES = 180 / Math.PI;

/**
 * Return the colour that the scene gives a pair.
 * @param {number} number
 * @returns {string}
 */
const colourOf = (number) => `hsl(${((0.58 + number * 0.381966) % 1) * 360} 75% 45%)`;

/**
 * @param {HTMLElement} box
 * @param {PairEditor | null} editor
 * @param {RegisterView} view
 * @param {RegisterActions} actions
 */
export function drawPanel(box, editor, view, actions) {
  const field = nameField(box);
  const name = field?.value;
  const typing = field !== null && document.activeElement === field;
  const folder = `/api/datasets/${encodeURIComponent(view.dataset ?? "")}`;
  fill(
    box,
    element("div", { class: "eyebrow" }, "Registration by hand"),
    element(
      "h1",
      { class: isDoubtful(editor) && !view.busy ? "verdict doubtful" : "verdict" },
      heading(editor, view),
    ),
    view.datasets.length
      ? null
      : element(
          "p",
          { class: "gain-note" },
          `No dataset in ${view.folder ?? "the datasets folder"} yet: ` +
            "import one, or put a folder there.",
        ),
    view.datasets.length
      ? element(
          "label",
          { class: "register-dataset" },
          "Dataset",
          element(
            "select",
            {
              "aria-label": "Dataset to register",
              onchange: ({ target }) => actions.choose(target.value),
            },
            view.datasets.map((one) =>
              element("option", { value: one, selected: one === view.dataset }, one),
            ),
          ),
        )
      : null,
    view.cannot ? errorCard(view.cannot) : null,
    editor && !view.cannot
      ? editor.values.found
        ? resultPart(editor.values.found, view, actions, name)
        : pairsPart(editor, view, actions)
      : null,
    view.names.length
      ? element(
          "section",
          {},
          element("h2", {}, "Accepted for this dataset"),
          element(
            "ul",
            { class: "register-names" },
            view.names.map((one) =>
              element(
                "li",
                {},
                element("span", {}, one),
                element(
                  "a",
                  {
                    href: `${folder}/registrations/${encodeURIComponent(one)}`,
                    download: `${view.dataset}-${one}.json`,
                  },
                  "Save as a file",
                ),
              ),
            ),
          ),
        )
      : null,
    element(
      "details",
      { class: "register-keys" },
      element("summary", {}, "Keys"),
      element(
        "dl",
        { class: "keys" },
        REGISTER_SHORTCUTS.flatMap(([key, what]) => [
          element("dt", {}, key),
          element("dd", {}, what),
        ]),
      ),
    ),
  );
  const next = typing ? nameField(box) : null;
  next?.focus();
  next?.setSelectionRange(next.value.length, next.value.length);
}

/**
 * Say whether a result is there that has a doubt.
 * @param {PairEditor | null} editor
 * @returns {boolean}
 */
const isDoubtful = (editor) => Boolean(editor?.values.found?.registration.warnings.length);

/**
 * @param {PairEditor | null} editor
 * @param {RegisterView} view
 * @returns {string}
 */
function heading(editor, view) {
  if (!editor) return "Lay the cloud onto the phantom";
  if (view.busy) return view.busy;
  const { found, pairs } = editor.values;
  const count = completePairs(pairs).length;
  if (found) {
    const { residual_before: before, residual_after: after } = found.registration;
    const change = `${formatMm(before)} before, ${formatMm(after)} after ICP`;
    return isDoubtful(editor) ? `Doubtful: ${found.registration.warnings[0]}` : change;
  }
  if (view.problem) return "These pairs do not fit yet";
  if (view.fit) return `${count} pairs fit to ${formatMm(view.fit.rms)} RMS`;
  return count
    ? `${3 - count} more ${count === 2 ? "pair" : "pairs"} for a fit`
    : "Click a point of the cloud, then the same point of the phantom";
}

/**
 * @param {PairEditor} editor
 * @param {RegisterView} view
 * @param {RegisterActions} actions
 * @returns {Child[]}
 */
function pairsPart(editor, view, actions) {
  const { pairs } = editor.values;
  const shared = view.problem && !view.problem.at.length;
  return [
    view.missed ? element("p", { class: "note-card", role: "status" }, view.missed) : null,
    view.refused ? errorCard(view.refused) : null,
    shared
      ? element(
          "div",
          { class: "note-card bad", role: "alert" },
          element("strong", {}, "No fit"),
          capitalise(view.problem?.message ?? ""),
        )
      : null,
    element(
      "section",
      {},
      element("h2", {}, "Pairs", element("small", {}, "residual, mm")),
      pairs.length
        ? element(
            "table",
            { class: "register-pairs" },
            element(
              "tbody",
              {},
              pairs.flatMap((pair, number) => pairRow(pair, number, editor, view)),
            ),
          )
        : element(
            "p",
            { class: "empty" },
            "None yet. Corners, edges and tips tell most; three pairs far apart are enough.",
          ),
    ),
    (view.fit?.warnings ?? []).map((text) => element("div", { class: "note-card" }, text)),
    Object.keys(view.landmarks).length
      ? element(
          "section",
          {},
          element("h2", {}, "Landmarks", element("small", {}, "as the phantom’s point")),
          element(
            "div",
            { class: "register-landmarks" },
            Object.keys(view.landmarks).map((name) =>
              element(
                "button",
                {
                  type: "button",
                  class: "button small",
                  "data-landmark": name,
                  "aria-pressed": String(pairs.some((pair) => pair.landmark === name)),
                  onclick: () => actions.landmark(name),
                },
                name,
              ),
            ),
          ),
        )
      : null,
    element(
      "div",
      { class: "actions" },
      element(
        "button",
        {
          class: "button strong",
          type: "button",
          disabled: !view.fit || Boolean(view.busy),
          title: "Enter",
          onclick: () => actions.refine(),
        },
        view.busy ? "Working …" : "Refine by ICP",
      ),
      element(
        "button",
        {
          class: "button",
          type: "button",
          disabled: !editor.canUndo(),
          title: "Ctrl+Z",
          onclick: editor.undo,
        },
        "Undo",
      ),
      element(
        "button",
        { class: "button", type: "button", disabled: !pairs.length, onclick: actions.clear },
        "Clear",
      ),
    ),
  ];
}

/**
 * Create the row of a pair, and below it the row with its error.
 * @param {PointPair} pair
 * @param {number} number
 * @param {PairEditor} editor
 * @param {RegisterView} view
 * @returns {Child[]}
 */
function pairRow(pair, number, editor, view) {
  const at = view.fit?.of.indexOf(number) ?? -1;
  const chosen = editor.values.chosen;
  /**
   * @param {Side} side
   * @param {string} label
   * @returns {HTMLElement}
   */
  const end = (side, label) =>
    element(
      "button",
      {
        type: "button",
        class: "link",
        "data-end": `${number}-${side}`,
        "aria-pressed": String(chosen?.[0] === number && chosen[1] === side),
        disabled: !pair[side],
        title: pair[side] ? "Choose this end, to move it" : "Not clicked yet",
        onclick: () => editor.choose(number, side),
      },
      pair[side] ? label : "–",
    );
  const problem = view.problem?.at.includes(number) ? view.problem : null;
  const [first, second] = problem?.at ?? [];
  const swap = problem?.at.length === 2 && /exchanging/.test(problem.message);
  return [
    element(
      "tr",
      { "data-pair": number, class: problem ? "bad" : "" },
      element(
        "th",
        {},
        element(
          "b",
          { class: "pair-number", style: { background: colourOf(number) } },
          String(number + 1),
        ),
      ),
      element("td", {}, end("cloud", "cloud")),
      element("td", {}, end("mesh", pair.landmark ?? "phantom")),
      element(
        "td",
        { class: "number", "data-residual": number },
        at >= 0 ? formatMm(view.fit?.residuals[at], false) : pair.cloud && pair.mesh ? "…" : "",
      ),
      element(
        "td",
        {},
        element(
          "button",
          {
            class: "icon-button",
            type: "button",
            title: `Leave pair ${number + 1} out`,
            onclick: () => editor.leaveOut(number),
          },
          icon("close"),
        ),
      ),
    ),
    problem && first === number
      ? element(
          "tr",
          { class: "said" },
          element(
            "td",
            { colspan: 5 },
            element(
              "div",
              { class: "note-card bad", role: "alert" },
              capitalise(problem.message),
              swap
                ? element(
                    "p",
                    {},
                    element(
                      "button",
                      {
                        class: "button small",
                        type: "button",
                        onclick: () => editor.exchange(first, second),
                      },
                      "Exchange them",
                    ),
                  )
                : null,
            ),
          ),
        )
      : null,
  ];
}

/**
 * @param {IcpResult} found
 * @param {RegisterView} view
 * @param {RegisterActions} actions
 * @param {string} [name] as typed so far
 * @returns {Child[]}
 */
function resultPart({ registration: found }, view, actions, name) {
  const firm = found.directions.at(0);
  /**
   * @param {string} label
   * @param {...Child} value
   * @returns {HTMLElement}
   */
  const fact = (label, ...value) =>
    element("tr", {}, element("th", {}, label), element("td", { class: "number" }, ...value));
  return [
    element(
      "section",
      {},
      element("h2", {}, "What ICP did"),
      element(
        "table",
        {},
        element(
          "tbody",
          {},
          fact(
            "Residual before",
            element("b", { id: "register-before" }, formatMm(found.residual_before)),
          ),
          fact(
            "Residual after",
            element("b", { id: "register-after" }, formatMm(found.residual_after)),
          ),
          fact("Points compared", String(found.points)),
          fact("Moved by", formatMm(found.moved)),
          fact("Turned by", `${(found.turned * DEGREES).toFixed(2)}°`),
        ),
      ),
    ),
    element(
      "section",
      {},
      element("h2", {}, "How sure"),
      found.weak_directions.length
        ? [
            element(
              "p",
              { class: "gain-note" },
              "The cloud determines these directions weakly; the arrows show them.",
            ),
            found.weak_directions.map((text) =>
              element("div", { class: "note-card", "data-weak": "" }, capitalise(text)),
            ),
          ]
        : element(
            "p",
            { class: "gain-note", "data-firm": "" },
            firm
              ? `Every direction is firm; the weakest, mostly ${dominantPart(firm.parts)}, ` +
                  `is known to ± ${formatMm(firm.sigma)}.`
              : "",
          ),
    ),
    found.warnings.length > 1
      ? element(
          "section",
          {},
          element("h2", {}, "Doubtful, too"),
          found.warnings.slice(1).map((text) => element("div", { class: "note-card" }, text)),
        )
      : null,
    view.refused ? errorCard(view.refused) : null,
    ...(view.accepted
      ? acceptedPart(view, actions)
      : [acceptForm(view, actions, found.warnings.length > 0, name)]),
  ];
}

/**
 * @param {RegisterView} view
 * @param {RegisterActions} actions
 * @returns {Child[]}
 */
const acceptedPart = (view, actions) => [
  element(
    "div",
    { class: "note-card good", role: "status" },
    element("strong", {}, "Accepted"),
    `Kept as ${view.accepted}. A diagnosis or a sweep of ${view.dataset} can use it: ` +
      "choose it as “Camera” there.",
  ),
  element(
    "div",
    { class: "actions" },
    element(
      "button",
      { class: "button strong", type: "button", onclick: () => actions.openDataset() },
      "Open the dataset",
    ),
    element(
      "button",
      { class: "button", type: "button", title: "Esc", onclick: actions.back },
      "Back to the pairs",
    ),
  ),
];

/**
 * @param {RegisterView} view
 * @param {RegisterActions} actions
 * @param {boolean} doubtful whether accepting is the second choice
 * @param {string} [name]
 * @returns {HTMLElement}
 */
const acceptForm = (view, actions, doubtful, name) =>
  element(
    "form",
    {
      class: "register-accept",
      onsubmit: (event) => {
        event.preventDefault();
        actions.accept(String(new FormData(event.target).get("name")).trim());
      },
    },
    element(
      "label",
      {},
      "Name",
      element("input", {
        id: "register-name",
        name: "name",
        required: true,
        maxlength: 64,
        pattern: "[A-Za-z0-9][A-Za-z0-9._\\-]*",
        title: "Letters, digits, dot, dash, underscore",
        autocomplete: "off",
        value: name ?? freeName(view.names),
      }),
    ),
    element(
      "div",
      { class: "actions" },
      inOrder(
        doubtful,
        element(
          "button",
          {
            class: doubtful ? "button" : "button strong",
            type: "submit",
            disabled: Boolean(view.busy),
          },
          view.busy ? "Working …" : doubtful ? "Accept all the same" : "Accept",
        ),
        element(
          "button",
          {
            class: doubtful ? "button strong" : "button",
            type: "button",
            title: "Esc",
            onclick: actions.back,
          },
          "Back to the pairs",
        ),
      ),
    ),
  );

/**
 * @param {boolean} swapped
 * @param {HTMLElement} first
 * @param {HTMLElement} second
 * @returns {HTMLElement[]}
 */
const inOrder = (swapped, first, second) => (swapped ? [second, first] : [first, second]);

/**
 * Return a name that is not taken.
 * @param {string[]} names
 * @returns {string}
 */
function freeName(names) {
  for (let number = 1; ; number += 1)
    if (!names.includes(`by-hand-${number}`)) return `by-hand-${number}`;
}

/**
 * Return the name of the largest part of a direction.
 * @param {Record<string, number>} parts
 * @returns {string}
 */
const dominantPart = (parts) =>
  Object.entries(parts).sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]))[0][0];

/**
 * @param {HTMLElement} box
 * @returns {HTMLInputElement | null}
 */
const nameField = (box) => box.querySelector("#register-name");
