// Pointer and wheel on a look's timeline: zoom, pan, the cursor, and sequences that are drawn and
// dragged by their ends.
/** @import { CutEditor, LookRecording, LookScale } from "./types.js" */

const GRAB = 7; // distance of a bar's end within which a pointer grabs it [pixels]
const STILL = 3; // motion below which a press is a click [pixels]

/**
 * @typedef {object} PointerHost
 * @property {() => LookScale | null} scale
 * @property {() => CutEditor | null} editor
 * @property {() => LookRecording | null} recording
 * @property {(time: number) => void} goTo
 * @property {(factor: number, time?: number) => void} zoom
 * @property {(seconds: number) => void} pan
 * @property {(at: { time: number, x: number, near: number } | null) => void} hover
 * @property {(ends: [number, number] | null) => void} draw
 */
/**
 * What a press has begun.
 * @typedef {{ what: "end", key: number, edge: "start" | "end" }
 *   | { what: "new", from: number } | { what: "pan" }} Press
 */

/**
 * @param {HTMLCanvasElement} canvas
 * @param {PointerHost} host
 */
export function watchPointer(canvas, host) {
  /** @type {Press | null} */
  let press = null;
  let pressedAt = 0;
  let last = 0;
  let moved = false;
  canvas.addEventListener(
    "wheel",
    (event) => {
      const scale = host.scale();
      if (!scale) return;
      event.preventDefault();
      const perPixel = scale.timeAt(1) - scale.timeAt(0);
      const sideways = event.shiftKey ? event.deltaY : event.deltaX;
      if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY))
        host.pan(sideways * perPixel);
      else host.zoom(Math.exp(event.deltaY * 0.0015), scale.timeAt(event.offsetX));
    },
    { passive: false },
  );
  canvas.addEventListener("pointerdown", (event) => {
    const scale = host.scale();
    if (!scale || event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pressedAt = last = event.offsetX;
    moved = false;
    press = pressOf(event, scale);
  });
  canvas.addEventListener("pointermove", (event) => {
    const scale = host.scale();
    if (!scale) return;
    const time = scale.timeAt(event.offsetX);
    const perPixel = scale.timeAt(1) - scale.timeAt(0);
    if (!press) {
      canvas.style.cursor = cursorOf(pressOf(event, scale));
      host.hover({ time, x: event.offsetX, near: 3 * perPixel });
      return;
    }
    moved ||= Math.abs(event.offsetX - pressedAt) > STILL;
    if (!moved) return;
    host.hover(null);
    if (press.what === "end") host.editor()?.resize(press.key, press.edge, time, true);
    else if (press.what === "new") host.draw([press.from, time]);
    else host.pan((last - event.offsetX) * perPixel);
    last = event.offsetX;
  });
  canvas.addEventListener("pointerup", (event) => {
    const scale = host.scale();
    const recording = host.recording();
    if (!scale || !press || !recording) return;
    const time = scale.timeAt(event.offsetX);
    if (press.what === "new") {
      host.draw(null);
      if (moved) host.editor()?.add(recording.name, press.from, time);
    }
    if (press.what === "end") host.editor()?.release();
    if (!moved) click(event, scale, recording);
    press = null;
  });
  canvas.addEventListener("pointercancel", () => {
    press = null;
    host.draw(null);
    host.editor()?.release();
  });
  canvas.addEventListener("pointerleave", () => host.hover(null));

  /**
   * Choose the sequence under the pointer, and move the cursor to the time.
   * @param {PointerEvent} event
   * @param {LookScale} scale
   * @param {LookRecording} recording
   */
  function click(event, scale, recording) {
    const time = Math.max(recording.start, Math.min(recording.end, scale.timeAt(event.offsetX)));
    if (isInSequences(event, scale)) host.editor()?.select(sequenceAt(time)?.key ?? null);
    host.goTo(time);
  }

  /** @param {number} time */
  const sequenceAt = (time) => {
    const own = host.editor()?.of(host.recording()?.name ?? "") ?? [];
    return own.find(({ start, end }) => start <= time && time <= end) ?? null;
  };

  /**
   * Return what a press at this place begins.
   * @param {PointerEvent} event
   * @param {LookScale} scale
   * @returns {Press}
   */
  function pressOf(event, scale) {
    const editor = host.editor();
    if (!editor || !isInSequences(event, scale)) return { what: "pan" };
    const own = editor.of(host.recording()?.name ?? "");
    // The ends of the chosen sequence come first where two meet.
    own.sort((a, b) => Number(b.key === editor.selected) - Number(a.key === editor.selected));
    for (const { key, start, end } of own)
      for (const [edge, time] of /** @type {["start" | "end", number][]} */ ([
        ["start", start],
        ["end", end],
      ]))
        if (Math.abs(scale.x(time) - event.offsetX) <= GRAB) return { what: "end", key, edge };
    const time = scale.timeAt(event.offsetX);
    return sequenceAt(time) ? { what: "pan" } : { what: "new", from: time };
  }
}

/**
 * @param {PointerEvent} event
 * @param {LookScale} scale
 * @returns {boolean}
 */
const isInSequences = ({ offsetY }, { sequences }) =>
  sequences !== null && offsetY >= sequences[0] && offsetY <= sequences[1];

/**
 * @param {Press} press
 * @returns {string}
 */
const cursorOf = ({ what }) => ({ end: "ew-resize", new: "crosshair", pan: "default" })[what];
