// Where a slider stands: numbers along the coordinate in which a parameter acts, as a search moves them.
const MATRIX_TERM = 1.5; // a ball in an incompressible matrix acts by (k - 1) / (k + 3/2), Eshelby 1957
const STEPS = 1000;
const WIDEST = 60; // in scales; of a parameter with wider bounds the slider shows a part

const toCoordinate = ({ log, contrast }, value) =>
  contrast ? (value - 1) / (value + MATRIX_TERM) : log ? Math.log(value) : value;

const toValue = ({ log, contrast }, at) =>
  contrast ? (1 + MATRIX_TERM * at) / (1 - at) : log ? Math.exp(at) : at;

/** The ends of a slider as coordinates: the bounds, or where those are far apart a part of them around a beginning. */
export function sliderRange(item, beginning) {
  const low = item.low === null ? -Infinity : toCoordinate(item, item.low);
  const high = item.high === null ? Infinity : toCoordinate(item, item.high);
  if ((high - low) / item.scale <= WIDEST) return [low, high];
  const middle = toCoordinate(item, beginning);
  return [
    Math.max(low, middle - (WIDEST / 2) * item.scale),
    Math.min(high, middle + (WIDEST / 2) * item.scale),
  ];
}

/** Position 0 to 1000 of a value. */
export function toPosition(item, [low, high], value) {
  return Math.round(
    STEPS * Math.min(1, Math.max(0, (toCoordinate(item, value) - low) / (high - low))),
  );
}

/** The value at a position, within its bounds. */
export function fromPosition(item, [low, high], at) {
  const value = toValue(item, low + ((high - low) * at) / STEPS);
  return Math.min(item.high ?? Infinity, Math.max(item.low ?? -Infinity, value));
}
