// Where a slider stands: numbers along the coordinate in which a parameter acts, as a search moves them.
const MATRIX = 1.5; // a ball in an incompressible matrix acts by (k - 1) / (k + 3/2), Eshelby 1957
const STEPS = 1000;
const WIDE = 60; // in scales; of a parameter with wider bounds the slider shows a part

const forth = ({ log, contrast }, value) =>
  contrast ? (value - 1) / (value + MATRIX) : log ? Math.log(value) : value;

const back = ({ log, contrast }, at) =>
  contrast ? (1 + MATRIX * at) / (1 - at) : log ? Math.exp(at) : at;

/** The ends of a slider as coordinates: the bounds, or where those are far apart a part of them around a beginning. */
export function ends(item, beginning) {
  const low = item.low === null ? -Infinity : forth(item, item.low);
  const high = item.high === null ? Infinity : forth(item, item.high);
  if ((high - low) / item.scale <= WIDE) return [low, high];
  const middle = forth(item, beginning);
  return [
    Math.max(low, middle - (WIDE / 2) * item.scale),
    Math.min(high, middle + (WIDE / 2) * item.scale),
  ];
}

/** Position 0 to 1000 of a value. */
export function position(item, [low, high], value) {
  return Math.round(STEPS * Math.min(1, Math.max(0, (forth(item, value) - low) / (high - low))));
}

/** The value at a position, within its bounds. */
export function valueAt(item, [low, high], at) {
  const value = back(item, low + ((high - low) * at) / STEPS);
  return Math.min(item.high ?? Infinity, Math.max(item.low ?? -Infinity, value));
}
