// Dragging the tool in the scene: conversion of pointer positions into the phantom frame.
/** @import { ViewerWindow, ViserClient } from "./types.js" */

const GRAB_PIXELS = 14; // distance from the tool's centre within which a pointer grabs it
const STEEP = 0.85; // downward part of a line of sight above which a vertical plane is of no use

/**
 * Return viser's client.
 * @param {ViewerWindow} viewer
 * @returns {ViserClient}
 */
const client = (viewer) => {
  if (!viewer.__viserMutable) throw new Error("The scene has not loaded");
  return viewer.__viserMutable;
};

/**
 * Return the axes of the phantom frame in the viewer's frame.
 * @param {ViewerWindow} viewer
 * @returns {number[][]}
 */
const axes = (viewer) => {
  const turn = client(viewer).nodeRefFromName[""].matrixWorld.elements;
  return [0, 4, 8].map((column) => [turn[column], turn[column + 1], turn[column + 2]]);
};

/**
 * Convert a point or direction from the viewer's frame to the phantom frame.
 * @param {ViewerWindow} viewer
 * @param {number[]} vector
 * @returns {number[]}
 */
export const fromViewer = (viewer, vector) => axes(viewer).map((axis) => dot(axis, vector));

/**
 * Return the place of the viewer's camera in the phantom frame [m]; null before the scene has
 * loaded.
 * @param {ViewerWindow} viewer
 * @returns {number[] | null}
 */
export const eyeOf = (viewer) => {
  const place = viewer.__viserMutable?.camera.position;
  return place ? fromViewer(viewer, [place.x, place.y, place.z]) : null;
};

/**
 * @param {ViewerWindow} viewer
 * @param {number[]} vector
 * @returns {number[]}
 */
const toViewer = (viewer, vector) =>
  axes(viewer).reduce((sum, axis, i) => plus(sum, axis, vector[i]), [0, 0, 0]);

/**
 * @param {number[]} a
 * @param {number[]} b
 * @returns {number}
 */
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);

/**
 * Return a + times b.
 * @param {number[]} a
 * @param {number[]} b
 * @param {number} [times]
 * @returns {number[]}
 */
const plus = (a, b, times = 1) => a.map((value, i) => value + times * b[i]);

/**
 * @param {number[]} a
 * @returns {number[]}
 */
const unit = (a) => a.map((value) => value / Math.hypot(...a));

/**
 * Return origin [m] and unit direction of the ray through a pointer, phantom frame.
 * @param {ViewerWindow} viewer
 * @param {MouseEvent} event
 * @returns {{ from: number[], along: number[] }}
 */
function pointerRay(viewer, event) {
  const { camera, canvas } = client(viewer);
  const box = canvas.getBoundingClientRect();
  const [x, y] = [
    ((event.clientX - box.left) / box.width) * 2 - 1,
    1 - ((event.clientY - box.top) / box.height) * 2,
  ];
  const lens = camera.projectionMatrixInverse.elements;
  const world = camera.matrixWorld.elements;
  const own = [x * lens[0], y * lens[5], -1];
  const direction = [0, 1, 2].map((row) => dot(own, [world[row], world[row + 4], world[row + 8]]));
  return {
    from: fromViewer(viewer, [world[12], world[13], world[14]]),
    along: unit(fromViewer(viewer, direction)),
  };
}

/**
 * Return the pixel of a point [m] in the viewer's window.
 * @param {ViewerWindow} viewer
 * @param {number[]} point
 * @returns {[number, number]}
 */
export function onScreen(viewer, point) {
  const { camera, canvas } = client(viewer);
  const box = canvas.getBoundingClientRect();
  /**
   * @param {number[]} matrix
   * @param {number[]} vector
   * @returns {number[]}
   */
  const apply = (matrix, [x, y, z, w]) =>
    [0, 1, 2, 3].map(
      (row) => matrix[row] * x + matrix[row + 4] * y + matrix[row + 8] * z + matrix[row + 12] * w,
    );
  const [x, y, , w] = apply(
    camera.projectionMatrix.elements,
    apply(camera.matrixWorldInverse.elements, [...toViewer(viewer, point), 1]),
  );
  return [((x / w + 1) / 2) * box.width + box.left, ((1 - y / w) / 2) * box.height + box.top];
}

/**
 * Return whether a pointer is on the tool's sphere or near its centre.
 * @param {ViewerWindow} viewer
 * @param {MouseEvent} event
 * @param {number[]} centre
 * @param {number} radius
 * @returns {boolean}
 */
export function hitsTool(viewer, event, centre, radius) {
  const { from, along } = pointerRay(viewer, event);
  const way = plus(centre, from, -1);
  const beside = plus(way, along, -dot(way, along));
  const [x, y] = onScreen(viewer, centre);
  return (
    Math.hypot(...beside) < radius * 1.15 ||
    Math.hypot(x - event.clientX, y - event.clientY) < GRAB_PIXELS
  );
}

/**
 * Return where the pointer moves a dragged point [m]: in the vertical plane through it that faces
 * the camera, so that dragging down pushes; in the horizontal plane with `level` or where the
 * camera looks down.
 * @param {ViewerWindow} viewer
 * @param {MouseEvent} event
 * @param {number[]} held
 * @param {boolean} level
 * @returns {number[]}
 */
export function projectPointer(viewer, event, held, level) {
  const { from, along } = pointerRay(viewer, event);
  const flat = [along[0], along[1], 0];
  const normal = level || Math.abs(along[2]) > STEEP ? [0, 0, 1] : unit(flat);
  const share = dot(plus(held, from, -1), normal) / dot(along, normal);
  return Number.isFinite(share) && share > 0 ? plus(from, along, share) : held;
}
