// Maps of the error on the unfolded surface. Of a box: the top in the middle, the sides folded out;
// sides that were never seen are left out. Of any other shape: from above, steep parts folded out.
import { byId, element, fill } from "./dom.js";
import { bandIndex, scaleBar } from "./colour-scale.js";

/** @import { FrameValues, Palette, Patterns } from "./types.js" */

/** @typedef {"top" | "+x" | "-x" | "+y" | "-y"} FaceName */
/** @typedef {{ index: number, at: [number, number] }} Patch */
/**
 * A face of the box on the plane [m]: its patches, its rectangle [left, low, right, high], and the
 * median distance between patches.
 * @typedef {{ name: FaceName, patches: Patch[], rect: number[], spacing: number }} Face
 */
/** @typedef {{ faces: Face[], bounds: number[] }} UnfoldedBox */

/** @type {FaceName[]} */
const FACES = ["top", "+x", "-x", "+y", "-y"];

/**
 * Place on the plane of a point on a face of a box of a size.
 * @type {Record<FaceName, (point: number[], size: number[]) => [number, number]>}
 */
const UNFOLDED = {
  top: ([x, y]) => [x, y],
  "+x": ([, y, z], [sx, , sz]) => [sx / 2 + sz - z, y],
  "-x": ([, y, z], [sx, , sz]) => [-sx / 2 - (sz - z), y],
  "+y": ([x, , z], [, sy, sz]) => [x, sy / 2 + sz - z],
  "-y": ([x, , z], [, sy, sz]) => [x, -sy / 2 - (sz - z)],
};

/**
 * Rectangle of a face on the plane.
 * @type {Record<FaceName, (size: number[]) => number[]>}
 */
const FACE_RECTS = {
  top: ([sx, sy]) => [-sx / 2, -sy / 2, sx / 2, sy / 2],
  "+x": ([sx, sy, sz]) => [sx / 2, -sy / 2, sx / 2 + sz, sy / 2],
  "-x": ([sx, sy, sz]) => [-sx / 2 - sz, -sy / 2, -sx / 2, sy / 2],
  "+y": ([sx, sy, sz]) => [-sx / 2, sy / 2, sx / 2, sy / 2 + sz],
  "-y": ([sx, sy, sz]) => [-sx / 2, -sy / 2 - sz, sx / 2, -sy / 2],
};

/**
 * Create the maps of measured and predicted error; a click enlarges them.
 * @param {Patterns} patterns
 * @param {number[]} size edges of the box [m]
 * @param {Palette} palette
 * @param {boolean} [explained] whether there is a prediction
 * @returns {HTMLElement}
 */
export function patternSection(patterns, size, palette, explained = true) {
  const box = unfoldPatches(patterns, size);
  if (!box.faces.length)
    return element(
      "p",
      { class: "muted" },
      "No patch of the surface was seen often enough to draw a pattern.",
    );
  const maps = () =>
    element(
      "div",
      { class: "maps" },
      map("Measured error", "measured"),
      explained ? map("Predicted by the cause", "predicted") : null,
    );
  /**
   * @param {string} caption
   * @param {"measured" | "predicted"} key
   * @returns {HTMLElement}
   */
  const map = (caption, key) => {
    const canvas = element("canvas", { "data-pattern": key });
    // Drawn once it has a width, since the panel may be hidden while the report loads.
    const seen = new ResizeObserver(() => {
      if (!canvas.clientWidth) return;
      seen.disconnect();
      drawMap(canvas, box, patterns[key], patterns.limit, palette);
    });
    seen.observe(canvas);
    return element(
      "button",
      { class: "map", type: "button", title: "Enlarge", onclick: enlarge },
      element("span", { class: "caption" }, caption),
      canvas,
    );
  };
  const legend = () =>
    element(
      "div",
      { class: "map-legend" },
      scaleBar(palette.signed, patterns.limit),
      element(
        "p",
        { class: "note" },
        `Measured surface minus raw simulation in mm, seen from above, with ${
          isBox(patterns.normals) ? "the sides" : "steep parts"
        } folded out; grey was not seen.`,
      ),
    );
  function enlarge() {
    const dialog = byId("enlarged", HTMLDialogElement);
    if (dialog.open) {
      dialog.close();
      return;
    }
    fill(dialog, maps(), legend());
    dialog.showModal();
  }
  return element("div", {}, maps(), legend());
}

/**
 * Return the faces on which anything was seen, and the rectangle around them.
 * @param {Patterns} patterns
 * @param {number[]} size
 * @returns {UnfoldedBox}
 */
function unfoldPatches({ centres, normals, measured }, size) {
  if (!isBox(normals)) return unfoldFreeForm(centres, normals);
  /** @type {Record<FaceName, Patch[]>} */
  const byFace = { top: [], "+x": [], "-x": [], "+y": [], "-y": [] };
  centres.forEach((centre, index) => {
    const face = faceOf(normals[index]);
    if (face) byFace[face].push({ index, at: UNFOLDED[face](centre, size) });
  });
  const faces = FACES.filter((face) =>
    byFace[face].some(({ index }) => measured[index] !== null),
  ).map((name) => ({
    name,
    patches: byFace[name],
    rect: FACE_RECTS[name](size),
    spacing: medianSpacing(byFace[name]),
  }));
  const rects = faces.map(({ rect }) => rect);
  const bounds = [0, 1]
    .map((k) => Math.min(...rects.map((r) => r[k])))
    .concat([2, 3].map((k) => Math.max(...rects.map((r) => r[k]))));
  return { faces, bounds };
}

/**
 * Whether all patches lie on faces of a box along the axes.
 * @param {number[][]} normals
 * @returns {boolean}
 */
function isBox(normals) {
  return normals.every((normal) => Math.max(...normal.map(Math.abs)) > 0.999);
}

/**
 * Place the patches of a free form from above, steep ones farther out the lower they are.
 * @param {number[][]} centres
 * @param {number[][]} normals
 * @returns {UnfoldedBox}
 */
function unfoldFreeForm(centres, normals) {
  const top = Math.max(...centres.map(([, , z]) => z));
  /** @type {Patch[]} */
  const patches = centres.map(([x, y, z], index) => {
    const [u, v] = normals[index];
    const out = Math.hypot(u, v) * (top - z);
    return { index, at: [x + u * out, y + v * out] };
  });
  const spacing = medianSpacing(patches);
  const bounds = [0, 1]
    .map((k) => Math.min(...patches.map(({ at }) => at[k])) - spacing)
    .concat([0, 1].map((k) => Math.max(...patches.map(({ at }) => at[k])) + spacing));
  return { faces: [{ name: "top", patches, rect: bounds, spacing }], bounds };
}

/**
 * Return the face to which a normal belongs; null for the bottom.
 * @param {number[]} normal
 * @returns {FaceName | null}
 */
function faceOf(normal) {
  const axis = normal.map(Math.abs).indexOf(Math.max(...normal.map(Math.abs)));
  if (axis === 2) return normal[2] > 0 ? "top" : null;
  if (axis === 0) return normal[0] > 0 ? "+x" : "-x";
  return normal[1] > 0 ? "+y" : "-y";
}

/**
 * Return the median distance of a patch to its nearest neighbour [m].
 * @param {Patch[]} patches
 * @returns {number}
 */
function medianSpacing(patches) {
  const nearest = patches.map((a) =>
    Math.min(
      ...patches.map((b) =>
        a === b ? Infinity : Math.hypot(a.at[0] - b.at[0], a.at[1] - b.at[1]),
      ),
    ),
  );
  nearest.sort((a, b) => a - b);
  return nearest[Math.floor(nearest.length / 2)] || 0.003;
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {UnfoldedBox} box
 * @param {FrameValues} values
 * @param {number} limit
 * @param {Palette} palette
 */
function drawMap(canvas, { faces, bounds }, values, limit, palette) {
  const [left, low, right, high] = bounds;
  const ratio = devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio);
  const scale = width / (right - left);
  const height = Math.round((high - low) * scale);
  canvas.width = width;
  canvas.height = height;
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const image = pen.createImageData(width, height);
  for (const face of faces) {
    const field = interpolator(face, values);
    const [x0, y0, x1, y1] = face.rect;
    for (
      let row = Math.max(0, Math.round((high - y1) * scale));
      row < Math.min(height, Math.round((high - y0) * scale));
      row++
    ) {
      for (
        let column = Math.max(0, Math.round((x0 - left) * scale));
        column < Math.min(width, Math.round((x1 - left) * scale));
        column++
      ) {
        const value = field(left + (column + 0.5) / scale, high - (row + 0.5) / scale);
        const rgb =
          value === null
            ? palette.things.unseen
            : palette.signed[bandIndex(value, limit, palette.signed.length)];
        image.data.set([...rgb, value === null ? 110 : 255], 4 * (row * width + column));
      }
    }
  }
  pen.putImageData(image, 0, 0);
  pen.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--surface");
  pen.lineWidth = 1.5 * ratio;
  for (const {
    rect: [x0, y0, x1, y1],
  } of faces)
    pen.strokeRect((x0 - left) * scale, (high - y1) * scale, (x1 - x0) * scale, (y1 - y0) * scale);
}

/**
 * Return a function of a place on a face: a local mean of the patches around it; null where the
 * nearest patch was not seen or is too far away.
 * @param {Face} face
 * @param {FrameValues} values
 * @returns {(x: number, y: number) => number | null}
 */
function interpolator({ patches, spacing: step }, values) {
  /** @type {Map<string, { at: [number, number], value: number | null }[]>} */
  const cells = new Map();
  for (const { index, at } of patches) {
    const key = `${Math.floor(at[0] / step)},${Math.floor(at[1] / step)}`;
    cells.set(key, [...(cells.get(key) ?? []), { at, value: values[index] }]);
  }
  return (x, y) => {
    const column = Math.floor(x / step);
    const row = Math.floor(y / step);
    let total = 0;
    let sum = 0;
    let nearest = Infinity;
    let seen = false;
    for (let i = -2; i <= 2; i++)
      for (let j = -2; j <= 2; j++)
        for (const { at, value } of cells.get(`${column + i},${row + j}`) ?? []) {
          const distance = Math.hypot(at[0] - x, at[1] - y) / step;
          if (distance < nearest) {
            nearest = distance;
            seen = value !== null;
          }
          if (value === null) continue;
          const weight = Math.exp(-2.2 * distance * distance);
          total += weight;
          sum += weight * value;
        }
    return seen && nearest < 1.3 ? sum / total : null;
  };
}
