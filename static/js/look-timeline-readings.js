// What a look's timeline shows: its lanes, and what is read at a time.
import { formatMm } from "./format.js";

/** @import { CutSequence, LookRecording, LookStream } from "./types.js" */

/**
 * A lane: its share of what height is left, or its fixed height [pixels].
 * @typedef {object} Lane
 * @property {string} name
 * @property {string} title
 * @property {number} share
 * @property {number} fixed
 * @property {number} factor from SI units to those of the axis
 * @property {number[]} t
 * @property {{ name: string, ink: string, values: (number | null)[] }[]} curves
 * @property {LookStream | null} stream
 */

const BAR = 26; // height of the row of sequences [pixels]
const TICKS = 14; // and of that of clouds

/** @type {Record<string, string>} */
export const KINDS = { top: "Top", side: "Side", drag: "Drag", trace: "Trace", "": "No kind" };

/**
 * @param {LookRecording} recording
 * @returns {Lane[]}
 */
export function lanesOf(recording) {
  const { tool, force, clouds, streams } = recording;
  /** @param {string} role */
  const stream = (role) => streams.find((one) => one.role === role) ?? null;
  const none = { share: 0, fixed: 0, factor: 1, t: [], curves: [] };
  /** @type {Lane[]} */
  const lanes = [];
  if (tool?.t.length) {
    const values = tool.depth ?? tool.z;
    const name = tool.depth ? "depth" : "height";
    lanes.push({
      ...none,
      name: "tool",
      title: tool.depth ? "Depth into the surface, mm" : "Height of the tool (z), mm",
      share: 1.5,
      factor: 1e3,
      t: tool.t,
      curves: [{ name, ink: "tool", values }],
      stream: stream("pose"),
    });
  }
  if (force?.t.length)
    lanes.push({
      ...none,
      name: "force",
      title: "Force x, y, z, N",
      share: 1,
      t: force.t,
      curves: [
        { name: "x", ink: "axis-x", values: force.fx },
        { name: "y", ink: "axis-y", values: force.fy },
        { name: "z", ink: "axis-z", values: force.fz },
      ],
      stream: stream("wrench"),
    });
  if (clouds?.t.length)
    lanes.push({
      ...none,
      name: "clouds",
      title: "Clouds",
      fixed: TICKS,
      t: clouds.t,
      stream: stream("cloud"),
    });
  lanes.push({ ...none, name: "sequences", title: "Sequences", fixed: BAR, stream: null });
  return lanes;
}

/**
 * Return what there is at a time, a line for each lane, gap, fault, touch and sequence.
 * @param {LookRecording} recording
 * @param {CutSequence[]} sequences
 * @param {number} time
 * @param {number} near half a pixel or two [s]
 * @returns {string[]}
 */
export function summaryAt(recording, sequences, time, near) {
  const lines = [];
  for (const { name, t, curves } of lanesOf(recording)) {
    if (!curves.length) continue;
    const at = nearest(t, time);
    const values = curves.map((curve) => {
      const value = curve.values[at];
      if (value === null || value === undefined) return `${curve.name} –`;
      return name === "tool"
        ? `${curve.name} ${formatMm(value)}`
        : `${curve.name} ${value.toFixed(2)} N`;
    });
    lines.push(values.join("   "));
  }
  /** @param {{ start: number, end: number }} span */
  const within = ({ start, end }) => start - near <= time && time <= end + near;
  for (const { role, name, gaps, faults } of recording.streams) {
    if (!role) continue;
    for (const [start, end] of gaps)
      if (within({ start, end })) lines.push(`gap in ${name}: ${(end - start).toFixed(2)} s`);
    for (const { t, text } of faults) if (Math.abs(t - time) <= 2 * near) lines.push(text);
  }
  for (const touch of recording.touches)
    if (within(touch)) lines.push(`touch of ${touch.landmark}`);
  const { rest } = recording;
  if (rest && within({ start: rest[0], end: rest[1] }))
    lines.push("rest: frames of the rest cloud");
  for (const one of sequences) if (within(one)) lines.push(`sequence ${one.name}`);
  return lines;
}

/**
 * Return the index of the value nearest to a time; `times` ascend.
 * @param {number[]} times
 * @param {number} time
 * @returns {number}
 */
export function nearest(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= (times[high] ?? Infinity) - time ? low : high;
}
