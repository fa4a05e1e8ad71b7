// Dragging the tool in the scene: from a pointer over the viewer's canvas to places in the phantom frame.
const GRAB_PIXELS = 14; // pixels within which the tool is caught
const STEEP = 0.85; // a camera that looks down more than this sees no upright plane

/** Axes of the phantom frame, as the viewer's own frame has them: a rotation. */
const axes = (viewer) => {
  const turn = viewer.__viserMutable.nodeRefFromName[""].matrixWorld.elements;
  return [0, 4, 8].map((column) => [turn[column], turn[column + 1], turn[column + 2]]);
};
export const fromViewer = (viewer, place) => axes(viewer).map((axis) => dot(axis, place));
const toViewer = (viewer, place) =>
  axes(viewer).reduce((sum, axis, i) => plus(sum, axis, place[i]), [0, 0, 0]);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const plus = (a, b, times = 1) => a.map((value, i) => value + times * b[i]);
const unit = (a) => a.map((value) => value / Math.hypot(...a));

/** Origin and direction of the line of sight through a pointer, phantom frame [m]. */
export function pointerRay(viewer, event) {
  const { camera, canvas } = viewer.__viserMutable;
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

/** Where a place is in the viewer's window, in pixels. */
export function onScreen(viewer, place) {
  const { camera, canvas } = viewer.__viserMutable;
  const box = canvas.getBoundingClientRect();
  const apply = (matrix, [x, y, z, w]) =>
    [0, 1, 2, 3].map(
      (row) => matrix[row] * x + matrix[row + 4] * y + matrix[row + 8] * z + matrix[row + 12] * w,
    );
  const [x, y, , w] = apply(
    camera.projectionMatrix.elements,
    apply(camera.matrixWorldInverse.elements, [...toViewer(viewer, place), 1]),
  );
  return [((x / w + 1) / 2) * box.width + box.left, ((1 - y / w) / 2) * box.height + box.top];
}

/** Whether a pointer is on the ball of the tool, or next to it. */
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
 * Where the pointer leads a place that is held: in the upright plane that faces the camera, so that dragging down pushes; level
 * with `level` or where one looks down.
 */
export function projectPointer(viewer, event, held, level) {
  const { from, along } = pointerRay(viewer, event);
  const flat = [along[0], along[1], 0];
  const normal = level || Math.abs(along[2]) > STEEP ? [0, 0, 1] : unit(flat);
  const share = dot(plus(held, from, -1), normal) / dot(along, normal);
  return Number.isFinite(share) && share > 0 ? plus(from, along, share) : held;
}
