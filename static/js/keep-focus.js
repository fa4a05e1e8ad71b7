// Drawing anew without losing the keyboard's place.

/**
 * Draw a box anew; the control in it that had the focus has it again, found by an attribute.
 * @param {HTMLElement} box
 * @param {string} attribute
 * @param {() => void} draw
 */
export function keepFocus(box, attribute, draw) {
  const active = document.activeElement;
  const key = active && box.contains(active) ? active.getAttribute(attribute) : null;
  draw();
  if (key === null) return;
  const again = /** @type {HTMLElement | null} */ (
    box.querySelector(`[${attribute}="${CSS.escape(key)}"]`)
  );
  again?.focus({ preventScroll: true });
}
