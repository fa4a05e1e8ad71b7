// The streams of a look with their roles, and what was decided and doubted about them.
import { element } from "./dom.js";
import { capitalise } from "./format.js";

/** @import { ImportActions, ImportView, Look, LookStream, StreamRole } from "./types.js" */

/** @type {Record<StreamRole, string>} */
export const ROLES = {
  pose: "Tool’s poses",
  cloud: "Clouds",
  camera: "Camera of the clouds",
  wrench: "Forces",
};
/**
 * Roles that streams of a kind can have.
 * @type {Record<string, StreamRole[]>}
 */
const FITTING = {
  pose: ["pose"],
  cloud: ["cloud"],
  depth: ["cloud"],
  camera: ["camera"],
  wrench: ["wrench"],
};
const OTHER_CLOCK = 1; // delay between stamp and receipt that no delivery takes [s]

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @param {HTMLElement | null} problem
 * @returns {HTMLElement | null}
 */
export function streamsSection(view, actions, problem) {
  const { look } = view;
  if (!look) return null;
  const recording = look.recordings[view.recording];
  const streams = recording?.streams ?? [];
  return element(
    "section",
    { class: "import-step", "aria-label": "Streams" },
    element(
      "h2",
      {},
      look.source.kind === "dataset" ? "Streams" : "2  Streams",
      look.recordings.length > 1 ? element("small", {}, `of ${recording?.name}`) : null,
    ),
    element(
      "table",
      { class: "import-streams", "aria-label": "Streams" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th", { scope: "col" }, "Name, kind and type"),
          element("th", { scope: "col", class: "number" }, "Count, rate"),
          element("th", { scope: "col" }, "Frame, delay"),
          element("th", { scope: "col" }, "Taken as"),
        ),
      ),
      element(
        "tbody",
        {},
        streams.map((stream) => streamRow(stream, view, actions)),
      ),
    ),
    streams.length ? null : element("p", { class: "empty" }, "No stream was found."),
    problem,
    notes("Decided", told(look, look.decisions), "decided"),
    notes("Doubtful", told(look, look.warnings), "doubtful"),
  );
}

/**
 * @param {LookStream} stream
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function streamRow(stream, { look, job }, actions) {
  const { name, kind, type, samples, rate, delay, frame, role, gaps, faults } = stream;
  const fitting = FITTING[kind] ?? [];
  const flaws = [
    gaps.length ? `${gaps.length} ${gaps.length === 1 ? "gap" : "gaps"}` : "",
    faults.length ? `${faults.length} clock ${faults.length === 1 ? "fault" : "faults"}` : "",
  ].filter(Boolean);
  return element(
    "tr",
    { "data-stream": name, class: role ? "taken" : null },
    element(
      "th",
      { scope: "row" },
      element("span", { class: "stream-name" }, name),
      element("small", {}, [kind, lastWord(type)].filter(Boolean).join(", ")),
    ),
    element(
      "td",
      { class: "number" },
      String(samples),
      element("small", {}, rate && rate < 1e6 ? `${rate.toFixed(rate < 100 ? 1 : 0)} Hz` : "–"),
    ),
    element(
      "td",
      {},
      frame || "–",
      element("small", {}, formatDelay(delay)),
      flaws.length ? element("small", { class: "bad" }, flaws.join(", ")) : null,
    ),
    element(
      "td",
      {},
      look?.source.kind === "dataset" || !fitting.length
        ? role
          ? ROLES[role]
          : "–"
        : element(
            "select",
            {
              "aria-label": `Role of ${name}`,
              "data-key": `role ${name}`,
              disabled: job !== null,
              onchange: ({ target }) =>
                actions.setRole(name, /** @type {StreamRole} */ (target.value) || null),
            },
            element("option", { value: "", selected: !role }, "not taken"),
            fitting.map((one) =>
              element("option", { value: one, selected: role === one }, ROLES[one]),
            ),
          ),
    ),
  );
}

/**
 * @param {string} title
 * @param {string[]} sentences
 * @param {string} mark
 * @returns {HTMLElement | null}
 */
function notes(title, sentences, mark) {
  if (!sentences.length) return null;
  const open = mark === "doubtful" || sentences.length <= 2;
  return element(
    "details",
    { class: `import-notes ${mark}`, open },
    element("summary", {}, `${title} (${sentences.length})`),
    element(
      "ul",
      {},
      sentences.map((text) => element("li", {}, capitalise(text))),
    ),
  );
}

/**
 * Return sentences with times counted from the start of the recording, as the timeline has them.
 * @param {Look} look
 * @param {string[]} sentences
 * @returns {string[]}
 */
const told = ({ recordings }, sentences) =>
  sentences.map((text) =>
    text.replace(/\b\d{6,}\.\d+/g, (number) => {
      const within = recordings.find(
        ({ start, end }) => start - 1 <= +number && +number <= end + 1,
      );
      return within ? (+number - within.start).toFixed(2) : number;
    }),
  );

/**
 * @param {number | null} seconds
 * @returns {string}
 */
const formatDelay = (seconds) =>
  seconds === null
    ? "–"
    : Math.abs(seconds) > OTHER_CLOCK
      ? "another clock"
      : `${(1e3 * seconds).toFixed(1)} ms`;

/**
 * @param {string} type such as geometry_msgs/msg/PoseStamped
 * @returns {string}
 */
const lastWord = (type) => type.split("/").at(-1) ?? type;
