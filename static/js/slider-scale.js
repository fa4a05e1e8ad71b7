// Conversion between a parameter's value and the position of its slider, 0 to 1000. The slider
// is linear in the parameter's coordinate: its logarithm, the contrast of a stiffness ratio, or
// the value itself.
/** @import { Parameter } from "./types.js" */

// A ball of stiffness ratio k in an incompressible matrix acts by (k - 1) / (k + 3/2)
// (Eshelby 1957).
const MATRIX_TERM = 1.5;
const STEPS = 1000;
const WIDEST = 60; // multiples of the parameter's scale that a slider covers at most

/**
 * @param {Parameter} item
 * @param {number} value
 * @returns {number}
 */
const toCoordinate = ({ log, contrast }, value) =>
  contrast ? (value - 1) / (value + MATRIX_TERM) : log ? Math.log(value) : value;

/**
 * @param {Parameter} item
 * @param {number} coordinate
 * @returns {number}
 */
const toValue = ({ log, contrast }, coordinate) =>
  contrast
    ? (1 + MATRIX_TERM * coordinate) / (1 - coordinate)
    : log
      ? Math.exp(coordinate)
      : coordinate;

/**
 * Return the coordinates of the slider's ends: the bounds, or where those are far apart a part of
 * them around the initial value.
 * @param {Parameter} item
 * @param {number} initial
 * @returns {[number, number]}
 */
export function sliderRange(item, initial) {
  const low = item.low === null ? -Infinity : toCoordinate(item, item.low);
  const high = item.high === null ? Infinity : toCoordinate(item, item.high);
  const scale = item.scale ?? 1;
  if ((high - low) / scale <= WIDEST) return [low, high];
  const middle = toCoordinate(item, initial);
  return [
    Math.max(low, middle - (WIDEST / 2) * scale),
    Math.min(high, middle + (WIDEST / 2) * scale),
  ];
}

/**
 * Return the slider's position for a value.
 * @param {Parameter} item
 * @param {[number, number]} range
 * @param {number} value
 * @returns {number}
 */
export function toPosition(item, [low, high], value) {
  return Math.round(
    STEPS * Math.min(1, Math.max(0, (toCoordinate(item, value) - low) / (high - low))),
  );
}

/**
 * Return the value at a slider's position, within the parameter's bounds.
 * @param {Parameter} item
 * @param {[number, number]} range
 * @param {number} position
 * @returns {number}
 */
export function fromPosition(item, [low, high], position) {
  const value = toValue(item, low + ((high - low) * position) / STEPS);
  return Math.min(item.high ?? Infinity, Math.max(item.low ?? -Infinity, value));
}
