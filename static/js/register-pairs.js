// Pairs of a manual registration as they are clicked: what is there, undo, and what outlives a reload. Nothing here draws.
const KEY = "palpate.register";
const INITIAL = {
  pairs: [],
  mode: "cloud",
  chosen: null,
  start: "stated",
  over: false,
  found: null,
};

const readStored = () => {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    return {};
  }
};

/** One dataset's unfinished registration; `changed` is called after every change, with whether the pairs are others now. */
export function createPairEditor(dataset, changed) {
  const values = { ...structuredClone(INITIAL), ...(readStored().of?.[dataset] ?? {}) };
  const past = [];
  const keep = () => {
    const all = readStored();
    localStorage.setItem(KEY, JSON.stringify({ dataset, of: { ...all.of, [dataset]: values } }));
  };
  keep();

  function set(changes) {
    Object.assign(values, changes);
    keep();
    changed(false);
  }

  /** Other pairs: what was before can be undone; what ICP found of the old ones is no longer so. */
  function put(pairs, more = {}) {
    past.push(JSON.stringify({ pairs: values.pairs, mode: values.mode, chosen: values.chosen }));
    Object.assign(values, { pairs, found: null, ...more });
    keep();
    changed(true);
  }

  /** Where the next point of a side goes: to the chosen end, else to the first pair that lacks one there. */
  function place(side, point, landmark = null, number = null) {
    const chosen = values.chosen?.[1] === side ? values.chosen[0] : null;
    const open = values.pairs.findIndex((pair) => !pair[side]);
    const at = number ?? chosen ?? (open >= 0 ? open : values.pairs.length);
    const pairs = structuredClone(values.pairs);
    pairs[at] = {
      cloud: null,
      mesh: null,
      landmark: null,
      ...pairs[at],
      [side]: point,
      ...(side === "mesh" ? { landmark } : {}),
    };
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
    choose: (number, side) =>
      set({
        chosen: number === null ? null : [number, side],
        ...(number === null ? {} : { mode: side }),
      }),
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
      if (past.length) {
        Object.assign(values, JSON.parse(past.pop()), { found: null });
        keep();
        changed(true);
      }
    },
    canUndo: () => past.length > 0,
  };
}

export const oppositeSide = (side) => (side === "cloud" ? "mesh" : "cloud");

const nextSide = (pairs, side) =>
  pairs.some((pair) => !pair[oppositeSide(side)]) ? oppositeSide(side) : "cloud";

/** Pairs with both ends, and which numbers they have. */
export const completePairs = (pairs) =>
  pairs.map((pair, number) => ({ ...pair, number })).filter(({ cloud, mesh }) => cloud && mesh);

export const lastDataset = () => readStored().dataset ?? null;
