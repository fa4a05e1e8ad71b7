// The free surface from above: where it is, how high, and its drawing on the pad of "Live".

/** @import { HeightMap } from "./types.js" */

/** @typedef {{ x: number, y: number, z: number }} Spot A place of the surface [m]. */

const LOWEST_SHADE = 0.3; // of the lowest places

/**
 * Return the place of the surface nearest to x, y as seen from above.
 * @param {HeightMap} map
 * @param {number} x
 * @param {number} y
 * @returns {Spot}
 */
export function nearestSpot({ corner, spacing, heights }, x, y) {
  const column = Math.round((x - corner[0]) / spacing);
  const row = Math.round((y - corner[1]) / spacing);
  const here = heights[row]?.[column];
  if (typeof here === "number") return { x, y, z: here };
  let found = { x, y, z: 0 };
  let least = Infinity;
  heights.forEach((line, i) =>
    line.forEach((z, j) => {
      if (z === null) return;
      const at = [corner[0] + j * spacing, corner[1] + i * spacing];
      const away = Math.hypot(at[0] - x, at[1] - y);
      if (away < least) [least, found] = [away, { x: at[0], y: at[1], z }];
    }),
  );
  return found;
}

/**
 * Return the outline of the surface as an SVG path, and its cells as another one.
 * @param {HeightMap} map
 * @param {(x: number, y: number) => [number, number]} toPixels
 * @returns {{ outline: string, cells: string }}
 */
export function surfacePaths({ corner, spacing, heights }, toPixels) {
  /** @type {(row: number, column: number) => boolean} */
  const filled = (row, column) => (heights[row]?.[column] ?? null) !== null;
  /** @type {(row: number, column: number) => string} */
  const knot = (row, column) =>
    toPixels(corner[0] + (column - 0.5) * spacing, corner[1] + (row - 0.5) * spacing)
      .map((value) => value.toFixed(1))
      .join(" ");
  let [outline, cells] = ["", ""];
  heights.forEach((line, i) =>
    line.forEach((z, j) => {
      if (z === null) return;
      const [a, b, c, d] = [knot(i, j), knot(i, j + 1), knot(i + 1, j + 1), knot(i + 1, j)];
      cells += `M${a}L${b}L${c}L${d}Z`;
      if (!filled(i - 1, j)) outline += `M${a}L${b}`;
      if (!filled(i, j + 1)) outline += `M${b}L${c}`;
      if (!filled(i + 1, j)) outline += `M${c}L${d}`;
      if (!filled(i, j - 1)) outline += `M${d}L${a}`;
    }),
  );
  return { outline, cells };
}

/**
 * Return a picture of the heights, a pixel for each cell: the lower, the darker.
 * @param {HeightMap} map
 * @returns {string}
 */
export function reliefPicture({ heights }) {
  const canvas = document.createElement("canvas");
  canvas.width = heights[0].length;
  canvas.height = heights.length;
  const pen = canvas.getContext("2d");
  const known = heights.flat().filter((z) => z !== null);
  const [low, high] = known.reduce(
    ([a, b], z) => [Math.min(a, z), Math.max(b, z)],
    [Infinity, -Infinity],
  );
  heights.forEach((line, i) =>
    line.forEach((z, j) => {
      if (z === null || !pen || high - low < 1e-4) return;
      pen.fillStyle = `rgb(0 0 0 / ${(LOWEST_SHADE * (high - z)) / (high - low)})`;
      pen.fillRect(j, heights.length - 1 - i, 1, 1);
    }),
  );
  return canvas.toDataURL();
}
