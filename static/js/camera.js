// Where the scene is looked at from, kept from visit to visit: the viewer itself begins anew each time.
import { put } from "./api.js";
import { fromViewer } from "./drag.js";
import { state } from "./store.js";

const KEY = "palpate.camera";
const SETTLE_MS = 500; // ms without motion after which a place is kept

/** Keep the place each time a person has turned, moved or zoomed. */
export function watchCamera(viewer) {
  let waiting = null;
  const later = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => save(viewer), SETTLE_MS);
  };
  for (const kind of ["pointerup", "wheel"])
    viewer.addEventListener(kind, later, { capture: true, passive: true });
}

function save(viewer) {
  const { camera, cameraControl: control } = viewer.__viserMutable ?? {};
  if (!camera || !control || !state().run) return;
  const target = control._target ?? control.getTarget();
  const place = (vector) =>
    fromViewer(viewer, [vector.x, vector.y, vector.z]).map((value) => +value.toFixed(6));
  localStorage.setItem(
    KEY,
    JSON.stringify({ run: state().run, position: place(camera.position), target: place(target) }),
  );
}

/** A standard view was asked for: it begins anew. */
export function forgetCamera() {
  localStorage.removeItem(KEY);
}

/** Tell the server before the viewer opens. */
export async function restoreCamera(page) {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY));
    if (kept) await put(`/sessions/${page}/camera`, kept);
  } catch {
    forgetCamera();
  }
}
