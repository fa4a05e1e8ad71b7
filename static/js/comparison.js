// Table of the models' errors by sequence; another run of the same dataset can be put beside
// this one.
import { get, toError } from "./api.js";
import { element, fill } from "./dom.js";
import { formatPercent, formatDateTime, readableName } from "./format.js";

/** @import { Comparison, RunEntry, RunHeading } from "./types.js" */

/**
 * Create the table, which loads its values, and the choice of another run.
 * @param {RunHeading} heading
 * @returns {HTMLElement[]}
 */
export function comparisonSection(heading) {
  const table = element("div", {}, element("p", { class: "muted" }, "Adding up…"));
  const choice = element("select", {
    "aria-label": "Compare with another diagnosis",
    hidden: true,
  });
  const load = async () => {
    const beside = choice.value ? `?beside=${encodeURIComponent(choice.value)}` : "";
    try {
      fill(
        table,
        comparisonTable(await get(`/runs/${encodeURIComponent(heading.id)}/comparison${beside}`)),
      );
    } catch (problem) {
      fill(table, element("div", { class: "note-card bad" }, toError(problem).message));
    }
  };
  choice.addEventListener("change", load);
  load();
  get("/runs")
    .then((/** @type {RunEntry[]} */ runs) => {
      const others = runs.filter(
        ({ id, dataset }) => id !== heading.id && dataset === heading.dataset,
      );
      if (!others.length) return;
      fill(
        choice,
        element("option", { value: "" }, "beside no other diagnosis"),
        others.map((run) =>
          element(
            "option",
            { value: run.id },
            `beside ${namesOf(run)}, ${formatDateTime(run.created)}`,
          ),
        ),
      );
      choice.hidden = false;
    })
    .catch(() => {}); // the sidebar reports a list that cannot be loaded
  return [table, choice];
}

/**
 * @param {Comparison} comparison
 * @returns {HTMLElement[]}
 */
function comparisonTable({ runs, sequences }) {
  const several = runs.length > 1;
  const names = runs.map((run, index) => `${index ? "the other" : "this"}: ${namesOf(run)}`);
  return [
    element(
      "table",
      { class: "comparison" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th", {}, ""),
          element("th", { class: "number" }, "raw"),
          names.map((name) => element("th", { class: "number" }, several ? name : "extended")),
          element("th", { class: "number" }, "floor"),
          several ? null : element("th", { class: "number" }, "removed"),
        ),
      ),
      element(
        "tbody",
        {},
        sequences.map(({ sequence, models }) => {
          const rows = runs.map(({ id }) => models[id]);
          const one = rows.find(Boolean);
          const best = Math.min(...rows.map((row) => row?.extended ?? Infinity));
          return element(
            "tr",
            {},
            element("th", {}, sequence, element("small", {}, one?.split ?? "")),
            element("td", { class: "number" }, threeDecimals(one?.raw)),
            rows.map((row) =>
              element(
                "td",
                { class: several && row?.extended === best ? "number best" : "number" },
                threeDecimals(row?.extended),
              ),
            ),
            element("td", { class: "number muted" }, threeDecimals(one?.noise_floor)),
            several ? null : element("td", { class: "number" }, formatPercent(one?.removed)),
          );
        }),
      ),
    ),
    element(
      "p",
      { class: "gain-note" },
      "Distance of the measured points from the model, over all frames; the gain above is of the " +
        "pushes alone, without the camera's fixed pattern.",
    ),
  ];
}

/**
 * Format a length in metres as millimetres without the unit.
 * @param {number | null | undefined} value
 * @returns {string}
 */
const threeDecimals = (value) => (typeof value === "number" ? (1000 * value).toFixed(3) : "–");

/**
 * Return the causes that a run found, or its verdict.
 * @param {RunEntry} run
 * @returns {string}
 */
const namesOf = ({ causes, verdict }) => causes.map(readableName).join(", ") || verdict;
