// Keeps the 3D camera in local storage, because the viewer starts with its own each time.
import { put } from "./api.js";
import { fromViewer } from "./drag.js";
import { state } from "./store.js";

/** @import { ViewerWindow, ViserClient } from "./types.js" */

const KEY = "palpate.camera";
const SETTLE_MS = 500; // ms without motion after which the camera is stored

/**
 * Store the camera each time a person has turned, moved or zoomed it.
 * @param {ViewerWindow} viewer
 */
export function watchCamera(viewer) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let waiting;
  const later = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => save(viewer), SETTLE_MS);
  };
  for (const kind of ["pointerup", "wheel"])
    viewer.addEventListener(kind, later, { capture: true, passive: true });
}

/**
 * Store position and target of the camera in the phantom frame.
 * @param {ViewerWindow} viewer
 */
function save(viewer) {
  const { camera, cameraControl: control } = /** @type {Partial<ViserClient>} */ (
    viewer.__viserMutable ?? {}
  );
  if (!camera || !control || !state().run) return;
  const target = control._target ?? control.getTarget();
  /** @param {{ x: number, y: number, z: number }} vector */
  const place = (vector) =>
    fromViewer(viewer, [vector.x, vector.y, vector.z]).map((value) => +value.toFixed(6));
  localStorage.setItem(
    KEY,
    JSON.stringify({ run: state().run, position: place(camera.position), target: place(target) }),
  );
}

/** Delete the stored camera, because a standard view was chosen. */
export function forgetCamera() {
  localStorage.removeItem(KEY);
}

/**
 * Send the stored camera to the server; to be done before the viewer loads.
 * @param {string} page
 */
export async function restoreCamera(page) {
  try {
    const stored = JSON.parse(localStorage.getItem(KEY) ?? "null");
    if (stored) await put(`/sessions/${page}/camera`, stored);
  } catch {
    forgetCamera();
  }
}
