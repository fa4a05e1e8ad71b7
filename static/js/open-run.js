// Opens a run: its report, the sequence and the frame that show most.
import { get } from "./api.js";
import { showProblem, showReport } from "./report-panel.js";
import { set, state } from "./store.js";
import * as timeline from "./timeline.js";

/**
 * @import {
 *   FrameValues, Patterns, Report, RunHeading, SequenceEntry, Series
 * } from "./types.js"
 */

/**
 * Show a run's report and its sequence.
 * @param {string} id
 */
export async function openRun(id) {
  set({ playing: false });
  try {
    /** @type {[RunHeading, Report, Patterns | null]} */
    const [heading, report, patterns] = await Promise.all([
      get(`/runs/${id}`),
      get(`/runs/${id}/report`),
      get(`/runs/${id}/patterns`).catch(() => null),
    ]);
    const names = heading.sequences.map(({ name }) => name);
    const sequence =
      state().run === id && names.includes(state().sequence ?? "")
        ? state().sequence
        : preferredSequence(heading.sequences);
    showReport(heading, report, patterns, state().palette);
    if (state().run !== id || state().sequence !== sequence)
      set({ frame: 0, series: null, loop: null });
    set({ run: id, sequence, heading, report });
    await openSequence();
  } catch (problem) {
    showProblem(problem);
  }
}

/**
 * Return the test sequence whose error the extended model reduces most; without test sequences,
 * of all.
 * @param {SequenceEntry[]} sequences
 * @returns {string | null}
 */
function preferredSequence(sequences) {
  const tested = sequences.filter(({ split }) => split === "test");
  /**
   * @param {SequenceEntry} entry
   * @returns {number}
   */
  const gain = ({ distance_raw: raw, distance_extended: extended }) => (raw ?? 0) - (extended ?? 0);
  return (
    [...(tested.length ? tested : sequences)].sort((a, b) => gain(b) - gain(a))[0]?.name ?? null
  );
}

/** Load the series of the chosen sequence, and on a new one go to the frame that shows most. */
export async function openSequence() {
  const { run, sequence } = state();
  if (!run || !sequence) return;
  /** @type {Series} */
  const series = await get(`/runs/${run}/sequences/${encodeURIComponent(sequence)}`);
  if (state().run !== run || state().sequence !== sequence) return;
  const fresh = state().series?.name !== sequence;
  set({ series });
  if (fresh && state().frame === 0) timeline.go(firstFrameShown(series));
}

/**
 * Return the frame whose error the extended model reduces most, else the one with the largest raw
 * error.
 * @param {Series} series
 * @returns {number}
 */
function firstFrameShown({ distance_raw: raw, distance_extended: extended }) {
  const gain = raw.map((error, frame) => (error ?? 0) - (extended?.[frame] ?? error ?? 0));
  return indexOfHighest(gain.some((value) => value > 0) ? gain : raw);
}

/**
 * @param {FrameValues} values
 * @returns {number}
 */
const indexOfHighest = (values) =>
  values.reduce(
    (/** @type {number} */ best, value, index) =>
      (value ?? 0) > (values[best] ?? 0) ? index : best,
    0,
  );
