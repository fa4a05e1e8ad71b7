// The right panel for a run: the verdict, causes, gain, error maps, rivals, and what the data
// cannot tell.
import { post, toast, toError } from "./api.js";
import { comparisonSection } from "./comparison.js";
import { byId, changedDataNote, element, fill } from "./dom.js";
import {
  capitalise,
  formatParameter,
  formatPercent,
  formatDateTime,
  readableName,
} from "./format.js";
import { openPanel } from "./panels.js";
import { patternSection } from "./error-maps.js";
import { clueRows, smallNote, unexplainedNote } from "./remaining-error.js";
import { stiffnessMap } from "./stiffness-map.js";

/**
 * @import {
 *   Cause, Child, ControlRow, Estimate, Gain, LimitRow, Palette, Palpation, Patterns,
 *   ProbeProposal, RankingRow, Report, RunHeading
 * } from "./types.js"
 */

const panel = () => byId("panel");

/**
 * @param {RunHeading} heading
 * @param {Report} report
 * @param {Patterns | null} patterns
 * @param {Palette | null} palette
 */
export function showReport(heading, report, patterns, palette) {
  const causes = report.causes ?? [];
  fill(
    panel(),
    element(
      "div",
      { class: "eyebrow" },
      element("span", { class: `verdict-tag ${report.verdict}` }, report.verdict),
      `${heading.folder ?? heading.dataset} · ${formatDateTime(heading.created)}`,
    ),
    element("h1", { class: "verdict" }, heading.sentence),
    element(
      "p",
      { class: "actions" },
      element(
        "a",
        {
          class: "button",
          href: `/api/runs/${encodeURIComponent(heading.id)}/report.html`,
          download: `${heading.id}.html`,
        },
        "Save as one file",
      ),
      exportButton(heading.id),
    ),
    changedDataNote(heading),
    (heading.notes ?? []).map((text) => element("p", { class: "gain-note" }, text)),
    causes.length
      ? section(
          report.verdict === "replay"
            ? "Added to the stated setup"
            : causes.length > 1
              ? "Causes"
              : "Cause",
          report.verdict === "replay" ? "" : "interval",
          causes.map((cause, number) => causeCard(cause, heading.chances?.[number])),
        )
      : null,
    report.gain
      ? section(
          "Error on sequences not fitted on",
          report.gain.unit ?? "mm",
          gainLadder(report.gain, causes.length > 0),
        )
      : null,
    heading.sequences?.length
      ? section("Every sequence", "RMS distance, mm", comparisonSection(heading))
      : null,
    patterns && palette
      ? section(
          causes.length ? "The error and its explanation" : "The error that is left",
          "",
          patternSection(patterns, heading.size, palette, causes.length > 0),
        )
      : null,
    report.palpation
      ? section(
          "Palpation",
          `${report.palpation.pushes} pushes`,
          palpationSummary(heading.id, report.palpation, causes),
        )
      : null,
    report.stiffness_map
      ? section("Stiffness from place to place", "", stiffnessMap(heading, report))
      : null,
    heading.ranking?.length
      ? section("Ranking", "", [
          rankingTable(heading.ranking),
          element("p", { class: "gain-note" }, heading.ranking_note ?? ""),
        ])
      : null,
    heading.limits?.length
      ? section(
          "What this data can tell",
          "smallest that would be named",
          detectionLimits(heading.limits),
        )
      : null,
    report.controls?.length
      ? section("Controls", "motions that were not made", controlRows(report.controls))
      : null,
    report.next_probe?.length
      ? section("Next probe", "would tell most", report.next_probe.map(probeEntry))
      : null,
    report.unexplained
      ? section("Unexplained", "", [
          unexplainedNote(report.unexplained),
          ...clueRows(report.unexplained.clues),
        ])
      : null,
    report.small_remainder
      ? section("Small remainder", "", smallNote(report.small_remainder))
      : null,
    report.identified?.length
      ? section("Told by the forces", "interval", report.identified.map(identifiedCard))
      : null,
    report.not_identifiable?.length
      ? section(
          "Cannot be told from this data",
          "",
          report.not_identifiable.map(unidentifiableCard),
        )
      : null,
  );
  panel().scrollTop = 0;
}

/**
 * Create the button that starts the export of reports, model and replays; the files are listed
 * with the job.
 * @param {string} run
 * @returns {HTMLElement}
 */
function exportButton(run) {
  const button = element(
    "button",
    {
      class: "button",
      type: "button",
      title: "Reports, model and replays as files",
      onclick: async () => {
        button.disabled = true;
        try {
          await post("/exports", { run, what: ["report", "model", "replays"] });
          openPanel("jobs");
        } catch (problem) {
          toast(problem);
        }
        button.disabled = false;
      },
    },
    "Export",
  );
  return button;
}

/** @param {unknown} error */
export function showProblem(error) {
  fill(
    panel(),
    element(
      "div",
      { class: "note-card bad" },
      element("strong", {}, "This run cannot be shown"),
      toError(error).message,
    ),
  );
}

/**
 * Say what to do while there is no run.
 * @param {boolean} hasDatasets
 */
export function showWelcome(hasDatasets) {
  fill(
    panel(),
    element(
      "div",
      { class: "empty-panel" },
      element("h1", {}, "No diagnosis yet"),
      hasDatasets
        ? "Choose a dataset on the left, check it, and start its diagnosis. " +
            "It takes a few minutes; the page shows how far it is."
        : element(
            "ol",
            {},
            element(
              "li",
              {},
              "Import a dataset (left, under Datasets), or start with ",
              element("code", {}, "palpate serve --datasets DIR"),
              ".",
            ),
            element(
              "li",
              {},
              "No data at hand? ",
              element("code", {}, "palpate demo"),
              " makes a phantom with a hidden effect and finds it.",
            ),
            element(
              "li",
              {},
              "The button “?” above leads from nothing to a sweep and a registration " +
                "in ten minutes.",
            ),
          ),
    ),
  );
}

/**
 * @param {string} title
 * @param {string} aside
 * @param {...Child} children
 * @returns {HTMLElement}
 */
const section = (title, aside, ...children) =>
  element(
    "section",
    {},
    element("h2", {}, title, aside ? element("small", {}, aside) : null),
    ...children,
  );

/**
 * @param {Cause} cause
 * @param {string} [chance] its probability as text
 * @returns {HTMLElement}
 */
function causeCard({ effect, probability, parameters, in_file_frame: inFile }, chance) {
  const rows = Object.entries(parameters ?? {}).map(([name, entry]) => {
    const shown = formatParameter(entry);
    return element(
      "tr",
      {},
      element("th", {}, readableName(name)),
      element(
        "td",
        { class: "number" },
        element("b", {}, shown.value),
        shown.unit ? ` ${shown.unit}` : "",
      ),
      element("td", { class: "number interval" }, openInterval(entry) ?? shown.interval),
    );
  });
  return element(
    "div",
    { class: "cause" },
    element(
      "div",
      { class: "cause-head" },
      element("strong", {}, capitalise(readableName(effect))),
      typeof probability === "number"
        ? element("span", {}, `probability ${chance ?? formatPercent(probability)}`)
        : null,
    ),
    element("table", {}, element("tbody", {}, rows)),
    inFile ? element("small", {}, placeInFile(inFile)) : null,
  );
}

/**
 * Say where a cause lies in the frame of the dataset's files.
 * @param {NonNullable<Cause["in_file_frame"]>} places
 * @returns {string}
 */
function placeInFile({ centre, polyline }) {
  const ends = centre ? [centre] : polyline?.length ? [polyline[0], polyline.at(-1) ?? []] : [];
  const shown = ends.map((at) => `(${at.map((value) => (value * 1e3).toFixed(1)).join(", ")})`);
  return `In the frame of the surface's file: ${shown.join(" to ")} mm`;
}

/**
 * Create the picture of pushes and footprint, and the table of forces and depths.
 * @param {string} run
 * @param {Palpation} summary
 * @param {Cause[]} causes
 * @returns {HTMLElement[]}
 */
function palpationSummary(run, { depth, force, young_modulus: modulus }, causes) {
  /** @type {[string, Estimate][]} */
  const rows = [
    ["pushed", depth],
    ["resisted with", force],
  ];
  if (modulus) rows.push(["Young's modulus", modulus]);
  for (const one of causes) {
    if (one.cover && one.depth)
      rows.push(["depth of its centre", one.depth], ["tissue above it", one.cover]);
  }
  return [
    element("img", {
      src: `/api/runs/${encodeURIComponent(run)}/pictures/palpation.png`,
      alt: "The pushes from above with the footprint of what was found, and a cut through it",
      class: "report-picture",
    }),
    element(
      "table",
      {},
      element(
        "tbody",
        {},
        rows.map(([name, entry]) => {
          const shown = formatParameter(entry);
          return element(
            "tr",
            {},
            element("th", {}, name),
            element("td", { class: "number" }, element("b", {}, shown.value), ` ${shown.unit}`),
            element(
              "td",
              { class: "number interval" },
              entry.low === undefined ? "" : shown.interval,
            ),
          );
        }),
      ),
    ),
  ];
}

/**
 * Return what to write in place of an interval that is open on a side, or none at all; null for a
 * closed one.
 * @param {Estimate} estimate
 * @returns {string | null}
 */
function openInterval({ identifiability, unit, low, high }) {
  if (identifiability === "at least")
    return `at least ${formatParameter({ value: low ?? "?", unit }).value}`;
  if (identifiability === "at most")
    return `at most ${formatParameter({ value: high ?? "?", unit }).value}`;
  return identifiability === "not identifiable" ? "not determined" : null;
}

/**
 * Create the bars of the errors on sequences that nothing was fitted on.
 * @param {Gain} gain
 * @param {boolean} named whether a cause was named
 * @returns {HTMLElement}
 */
function gainLadder(
  {
    baseline,
    extended,
    noise_floor: floor,
    unit = "mm",
    reducible_removed: removed,
    paper_metric: paper,
    split,
    ...others
  },
  named,
) {
  const added = named || typeof others.baseline_network === "number";
  /** @type {[string, number | null | undefined, string][]} */
  const all = [
    ["Raw model", baseline, "raw"],
    ["Raw + network", others.baseline_network, "corrected"],
    ["Extended", added ? extended : null, "extended"],
    ["Extended + network", others.extended_network, "corrected"],
    ["Noise floor", floor, "floor"],
  ];
  const steps = /** @type {[string, number, string][]} */ (
    all.filter(([, value]) => typeof value === "number")
  );
  const most = Math.max(...steps.map(([, value]) => value));
  /**
   * @param {number} value
   * @returns {string}
   */
  const number = (value) => (value < 10 ? value.toFixed(value < 1 ? 3 : 2) : value.toFixed(1));
  const range =
    removed && typeof removed.low === "number"
      ? ` (${formatPercent(removed.low)} to ${formatPercent(removed.high)})`
      : "";
  return element(
    "div",
    {},
    element(
      "div",
      { class: "ladder" },
      steps.flatMap(([label, value, colour]) => [
        element("span", {}, label),
        element(
          "div",
          { class: "bar" },
          element("i", {
            style: { width: `${(100 * value) / most}%`, background: `var(--${colour})` },
          }),
        ),
        element("span", { class: "bar-value" }, `${number(value)}`),
      ]),
    ),
    element(
      "p",
      { class: "gain-note" },
      !added
        ? "No cause was named, so the model stays as it was. "
        : removed && typeof removed.value === "number"
          ? [
              element("b", {}, formatPercent(removed.value)),
              `${range} of the error above the noise floor is gone on the ${split} sequences. `,
            ]
          : null,
      added ? tunedSentence(others.tuned?.value) : null,
      typeof paper?.baseline === "number" && typeof paper?.extended === "number"
        ? `Mean distance as in the literature: ${number(paper.baseline)}` +
            `${added ? ` → ${number(paper.extended)}` : ""} ${unit}.`
        : null,
    ),
  );
}

/**
 * @param {number | null | undefined} share of the error that the fit of the setup removes
 * @returns {string | null}
 */
function tunedSentence(share) {
  if (typeof share !== "number") return null;
  const effect = share > 0.005 ? `removes ${formatPercent(share)}` : "removes nothing";
  return (
    "The robot's pose, the tool's radius and Poisson's ratio were fitted within their accuracies " +
    `along with it; that alone, with no cause, ${effect}. `
  );
}

/**
 * @param {RankingRow[]} rows the named causes first
 * @returns {HTMLElement}
 */
function rankingTable(rows) {
  return element(
    "div",
    { class: "ranking" },
    element("span", { class: "head" }, "effect"),
    element("span", { class: "head" }, "error removed"),
    element("span"),
    element("span", { class: "head number" }, "prob."),
    rows.flatMap(({ effect, share, removed, probability, named }) => [
      element("span", {}, readableName(effect)),
      element(
        "div",
        { class: named ? "bar first" : "bar" },
        element("i", { style: { width: `${100 * share}%` } }),
      ),
      element("span", { class: "number" }, removed),
      element("span", { class: "number" }, probability),
    ]),
  );
}

/**
 * Create the list of the smallest effects that the data would show.
 * @param {LimitRow[]} rows
 * @returns {HTMLElement}
 */
function detectionLimits(rows) {
  return element(
    "div",
    { class: "told" },
    rows.flatMap(({ effect, size, like }) => [
      element("strong", {}, capitalise(readableName(effect))),
      element("span", { class: "number" }, size),
      element("small", {}, `like ${like}`),
    ]),
  );
}

/**
 * Create a line for each cause under each falsified motion: the share of its gain that is left.
 * @param {ControlRow[]} rows
 * @returns {HTMLElement}
 */
function controlRows(rows) {
  const several = new Set(rows.map(({ effect }) => effect)).size > 1;
  return element(
    "div",
    { class: "told" },
    rows.flatMap(({ control, effect, kept, passed, why }) => [
      element("strong", {}, capitalise(control)),
      element(
        "span",
        { class: passed === false ? "number failed" : "number" },
        passed === null ? "says nothing" : `${formatPercent(Math.max(0, kept))} of the gain left`,
      ),
      element(
        "small",
        {},
        [
          several || passed === false ? capitalise(readableName(effect)) : "",
          passed === false
            ? "it may not come of the pushes"
            : passed === null
              ? readableName(why ?? "")
              : "",
        ]
          .filter(Boolean)
          .join(": "),
      ),
    ]),
  );
}

/**
 * @param {ProbeProposal} proposal
 * @returns {HTMLElement}
 */
function probeEntry({ text, separates, probability }) {
  const names = separates.map((name) => (name === "none" ? "nothing" : readableName(name)));
  const chance =
    typeof probability === "number"
      ? `, ${probability > 0.99 ? "more than 99 %" : formatPercent(probability)} likely to decide`
      : "";
  return element(
    "div",
    { class: "probe" },
    element("span", {}, capitalise(text)),
    element("small", {}, `${capitalise(names[0])} or ${names[1]}${chance}`),
  );
}

/**
 * @param {NonNullable<Report["identified"]>[number]} entry
 * @returns {HTMLElement}
 */
const identifiedCard = ({ effect, why, parameters }) =>
  element(
    "div",
    { class: "note-card" },
    element("strong", {}, capitalise(readableName(effect))),
    Object.entries(parameters).map(([name, entry]) => {
      const { value, unit, interval } = formatParameter(entry);
      return `${readableName(name)} = ${value} ${unit} (${interval}). `;
    }),
    why ? `${capitalise(why)}.` : "",
  );

/**
 * @param {NonNullable<Report["not_identifiable"]>[number]} entry
 * @returns {HTMLElement}
 */
const unidentifiableCard = ({ effect, why, measure_instead: instead }) =>
  element(
    "div",
    { class: "note-card" },
    element("strong", {}, capitalise(readableName(effect))),
    why ? `${capitalise(why)}. ` : "",
    instead ? `Measure instead: ${instead}.` : "",
  );
