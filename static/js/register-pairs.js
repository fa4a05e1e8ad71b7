// The pairs of a registration by hand: changes, undo, and storage that outlives a reload.
// Nothing here draws.
/** @import { CompletePair, PairEditor, PairValues, Point, PointPair, Side } from "./types.js" */

const KEY = "palpate.register";
/** @type {PairValues} */
const INITIAL = {
  pairs: [],
  mode: "cloud",
  chosen: null,
  start: "stated",
  over: false,
  found: null,
};

/**
 * Return what is stored: the last dataset, and the pairs of each dataset in `of`.
 * @returns {{ dataset?: string, of?: Record<string, PairValues> }}
 */
const readStored = () => {
  try {
    return JSON.parse(localStorage.getItem(KEY) ?? "{}") ?? {};
  } catch {
    return {};
  }
};

/**
 * Return the pairs of a dataset with the functions that change them.
 * @param {string} dataset
 * @param {(pairsChanged: boolean) => void} changed called after every change
 * @returns {PairEditor}
 */
export function createPairEditor(dataset, changed) {
  /** @type {PairValues} */
  const values = { ...structuredClone(INITIAL), ...(readStored().of?.[dataset] ?? {}) };
  /** @type {string[]} */
  const undoStack = [];
  const keep = () => {
    const all = readStored();
    localStorage.setItem(KEY, JSON.stringify({ dataset, of: { ...all.of, [dataset]: values } }));
  };
  keep();

  /**
   * Change values that are not undone.
   * @param {Partial<PairValues>} changes
   */
  function set(changes) {
    Object.assign(values, changes);
    keep();
    changed(false);
  }

  /**
   * Replace the pairs, which can be undone; a result of ICP for the old ones is dropped.
   * @param {PointPair[]} pairs
   * @param {Partial<PairValues>} [more]
   */
  function put(pairs, more = {}) {
    undoStack.push(
      JSON.stringify({ pairs: values.pairs, mode: values.mode, chosen: values.chosen }),
    );
    Object.assign(values, { pairs, found: null, ...more });
    keep();
    changed(true);
  }

  /**
   * Place a point of a side: at the pair `number`, else at the chosen end, else at the first pair
   * without a point on this side.
   * @param {Side} side
   * @param {Point} point
   * @param {string | null} [landmark]
   * @param {number | null} [number]
   */
  function place(side, point, landmark = null, number = null) {
    const chosen = values.chosen?.[1] === side ? values.chosen[0] : null;
    const open = values.pairs.findIndex((pair) => !pair[side]);
    const at = number ?? chosen ?? (open >= 0 ? open : values.pairs.length);
    const pairs = structuredClone(values.pairs);
    const pair = pairs[at] ?? { cloud: null, mesh: null, landmark: null };
    pairs[at] = side === "mesh" ? { ...pair, mesh: point, landmark } : { ...pair, cloud: point };
    const placed = number ?? chosen;
    put(
      pairs,
      placed === null
        ? {
            mode: pairs[at][oppositeSide(side)] ? nextSide(pairs, side) : oppositeSide(side),
            chosen: null,
          }
        : {},
    );
  }

  return {
    values,
    set,
    put,
    place,
    choose: (number, side = values.mode) =>
      set(number === null ? { chosen: null } : { chosen: [number, side], mode: side }),
    leaveOut: (number) =>
      put(
        values.pairs.filter((_, at) => at !== number),
        { chosen: null },
      ),
    exchange: (a, b) => {
      const pairs = structuredClone(values.pairs);
      [pairs[a].mesh, pairs[b].mesh] = [pairs[b].mesh, pairs[a].mesh];
      [pairs[a].landmark, pairs[b].landmark] = [pairs[b].landmark, pairs[a].landmark];
      put(pairs, { chosen: null });
    },
    undo: () => {
      const last = undoStack.pop();
      if (last) {
        Object.assign(values, JSON.parse(last), { found: null });
        keep();
        changed(true);
      }
    },
    canUndo: () => undoStack.length > 0,
  };
}

/**
 * @param {Side} side
 * @returns {Side}
 */
const oppositeSide = (side) => (side === "cloud" ? "mesh" : "cloud");

/**
 * Return the side of the next click after a pair was completed on a side.
 * @param {PointPair[]} pairs
 * @param {Side} side
 * @returns {Side}
 */
const nextSide = (pairs, side) =>
  pairs.some((pair) => !pair[oppositeSide(side)]) ? oppositeSide(side) : "cloud";

/**
 * Return the pairs that have both points, with their numbers in the list.
 * @param {PointPair[]} pairs
 * @returns {CompletePair[]}
 */
export const completePairs = (pairs) =>
  pairs.flatMap((pair, number) => {
    const { cloud, mesh } = pair;
    return cloud && mesh ? [{ ...pair, cloud, mesh, number }] : [];
  });

/**
 * Return the dataset that was registered last.
 * @returns {string | null}
 */
export const lastDataset = () => readStored().dataset ?? null;
