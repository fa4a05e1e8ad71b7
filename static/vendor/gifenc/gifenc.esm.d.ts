// Types of the functions of gifenc that the page calls.
type Pixels = Uint8Array | Uint8ClampedArray;
type Palette = number[][];

interface Encoder {
  /** Append a frame; `delay` is in ms. */
  writeFrame(
    index: Uint8Array,
    width: number,
    height: number,
    options: { palette: Palette; delay: number },
  ): void;
  finish(): void;
  bytes(): Uint8Array<ArrayBuffer>;
}

export function GIFEncoder(): Encoder;
export function quantize(rgba: Pixels, maxColors: number): Palette;
export function applyPalette(rgba: Pixels, palette: Palette): Uint8Array;
