// The sequences of a look while they are cut by hand: changes, undo, redo, and what is wrong with
// them. Nothing here draws.
/** @import { CutEditor, CutProblem, CutSequence, LookRecording } from "./types.js" */

const SHORTEST = 0.2; // of a sequence [s]
const NAME = /^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/;

/**
 * Return the sequences that a look found, to be edited.
 * @param {LookRecording[]} recordings
 * @returns {CutSequence[]}
 */
export function foundSequences(recordings) {
  let key = 0;
  return recordings.flatMap(({ name: recording, sequences }) =>
    sequences.map(({ name, start, end, kind, split }) => ({
      key: ++key,
      recording,
      name,
      start,
      end,
      kind: kind ?? "",
      split: split === "none" ? null : split || null,
    })),
  );
}

/**
 * Return an editor of the sequences of a look.
 * @param {LookRecording[]} recordings
 * @param {CutSequence[] | null} kept sequences of an earlier visit; null for those that were found
 * @param {(cut: boolean) => void} changed called after every change; `cut` is false where only
 *   the choice has changed
 * @returns {CutEditor}
 */
export function createCutEditor(recordings, kept, changed) {
  const found = foundSequences(recordings);
  let sequences = kept ?? found;
  /** @type {number | null} */
  let selected = null;
  /** @type {string[]} */
  const undone = [];
  /** @type {string[]} */
  const done = [];
  /** @type {string | null} */
  let drag = null; // the change that goes on, so that it is undone as one

  /**
   * Replace the sequences.
   * @param {CutSequence[]} next
   * @param {string | null} [mark] of a change in many small steps
   */
  function put(next, mark = null) {
    if (!mark || mark !== drag) done.push(JSON.stringify([sequences, selected]));
    drag = mark;
    undone.length = 0;
    sequences = next;
    changed(true);
  }

  /**
   * @param {string[]} from
   * @param {string[]} to
   */
  function step(from, to) {
    const state = from.pop();
    if (!state) return;
    to.push(JSON.stringify([sequences, selected]));
    [sequences, selected] = JSON.parse(state);
    drag = null;
    changed(true);
  }

  /** @param {number | null} key */
  function select(key) {
    if (key === selected) return;
    selected = key;
    changed(false);
  }

  /** @param {number} key */
  const byKey = (key) => sequences.find((one) => one.key === key) ?? null;

  /** @param {string} recording */
  const of = (recording) =>
    sequences.filter((one) => one.recording === recording).sort((a, b) => a.start - b.start);

  /**
   * Return the times between which a sequence may lie, so that none overlap.
   * @param {string} recording
   * @param {number} middle a time in it
   * @param {number | null} except key of the sequence itself
   * @returns {[number, number]}
   */
  function room(recording, middle, except) {
    const whole = recordings.find(({ name }) => name === recording);
    const others = of(recording).filter(({ key }) => key !== except);
    const ends = others.filter(({ end }) => end <= middle).map(({ end }) => end);
    const starts = others.filter(({ start }) => start >= middle).map(({ start }) => start);
    return [
      Math.max(whole?.start ?? -Infinity, ...ends),
      Math.min(whole?.end ?? Infinity, ...starts),
    ];
  }

  const nextKey = () => Math.max(0, ...sequences.map(({ key }) => key)) + 1;

  return {
    get sequences() {
      return sequences;
    },
    get selected() {
      return byKey(selected ?? -1) ? selected : null;
    },
    get changed() {
      return JSON.stringify(plain(sequences)) !== JSON.stringify(plain(found));
    },
    of,
    chosen: () => byKey(selected ?? -1),
    select,
    neighbour: (recording, by) => {
      const own = of(recording);
      if (!own.length) return;
      const at = own.findIndex(({ key }) => key === selected);
      const next = at < 0 ? (by > 0 ? 0 : own.length - 1) : at + by;
      select(own[Math.max(0, Math.min(own.length - 1, next))].key);
    },
    resize: (key, edge, time, dragged = false) => {
      const one = byKey(key);
      if (!one || !Number.isFinite(time)) return;
      const [low, high] = room(one.recording, (one.start + one.end) / 2, key);
      const moved =
        edge === "start"
          ? { start: Math.max(low, Math.min(one.end - SHORTEST, time)) }
          : { end: Math.min(high, Math.max(one.start + SHORTEST, time)) };
      put(
        sequences.map((other) => (other.key === key ? { ...one, ...moved } : other)),
        dragged ? `${key} ${edge}` : null,
      );
    },
    alter: (key, changes) =>
      put(sequences.map((one) => (one.key === key ? { ...one, ...changes } : one))),
    add: (recording, from, to) => {
      if (of(recording).some((one) => one.start < from && from < one.end)) return;
      const [start, end] = [Math.min(from, to), Math.max(from, to)];
      const [low, high] = room(recording, from, null);
      const one = {
        key: nextKey(),
        recording,
        name: freeName("sequence-01", sequences),
        start: Math.max(low, start),
        end: Math.min(high, Math.max(end, start + SHORTEST)),
        kind: /** @type {const} */ (""),
        split: null,
      };
      if (one.end - one.start < SHORTEST * 0.999) return;
      put([...sequences, one]);
      select(one.key);
    },
    split: (key, time) => {
      const one = byKey(key);
      if (!one || time - one.start < SHORTEST || one.end - time < SHORTEST) return;
      const rest = { ...one, key: nextKey(), name: freeName(one.name, sequences), start: time };
      put([...sequences.map((other) => (other.key === key ? { ...one, end: time } : other)), rest]);
      select(rest.key);
    },
    remove: (key) => {
      const one = byKey(key);
      if (!one) return;
      put(sequences.filter((other) => other.key !== key));
      if (selected === key) select(null);
    },
    release: () => {
      drag = null;
    },
    undo: () => step(done, undone),
    redo: () => step(undone, done),
    canUndo: () => done.length > 0,
    canRedo: () => undone.length > 0,
    revert: () => put(foundSequences(recordings)),
    problems: () => problems(sequences),
  };
}

/**
 * Return the sequences without their keys, in the order of recording and time.
 * @param {CutSequence[]} sequences
 * @returns {Omit<CutSequence, "key">[]}
 */
export const plain = (sequences) =>
  sequences
    .map(({ key: _key, ...one }) => one)
    .sort((a, b) => a.recording.localeCompare(b.recording) || a.start - b.start);

/**
 * Return a name that no sequence has: the number at its end is counted on.
 * @param {string} name
 * @param {CutSequence[]} sequences
 * @returns {string}
 */
export function freeName(name, sequences) {
  const taken = new Set(sequences.map((one) => one.name));
  const stem = name.replace(/[-_.]?\d+$/, "") || name;
  for (let number = 1; ; number++) {
    const next = `${stem.slice(0, 58)}-${String(number).padStart(2, "0")}`;
    if (!taken.has(next)) return next;
  }
}

/**
 * Return what is wrong with the sequences, field by field.
 * @param {CutSequence[]} sequences
 * @returns {CutProblem[]}
 */
function problems(sequences) {
  /** @type {CutProblem[]} */
  const wrong = [];
  for (const { key, name } of sequences) {
    if (!NAME.test(name))
      wrong.push({
        key,
        field: "name",
        text:
          "A name has 1 to 64 letters, digits, dots, dashes or underscores; " +
          "a letter or digit first.",
      });
    else if (sequences.some((other) => other.key !== key && other.name === name))
      wrong.push({ key, field: "name", text: `Another sequence is called ${name}.` });
  }
  return wrong;
}
