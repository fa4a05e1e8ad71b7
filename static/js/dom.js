// Creation of elements. Text is inserted as text, never as markup.
/** @import { Attributes, Child } from "./types.js" */

/**
 * Create an element. Attributes named on... are event listeners, `style` is an object, as the
 * page's security policy refuses text; attributes that are false, null or undefined are left out,
 * and so are such children.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} name
 * @param {Attributes<HTMLElementTagNameMap[K]>} [attributes]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (key.startsWith("on"))
      node.addEventListener(key.slice(2), /** @type {EventListener} */ (value));
    else if (key === "style") Object.assign(node.style, value);
    else node.setAttribute(key, value === true ? "" : String(value));
  }
  node.append(...flattened(children));
  return node;
}

/**
 * Create an SVG element; an attribute that is null is left out.
 * @param {string} name
 * @param {Record<string, string | number | null>} attributes
 * @param {...Child} children
 * @returns {SVGElement}
 */
export function svgElement(name, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes))
    if (value !== null) node.setAttribute(key, String(value));
  node.append(...flattened(children));
  return /** @type {SVGElement} */ (node);
}

/**
 * Replace the children of a node, which may be given by its id, and return it.
 * @template {Element | string} T
 * @param {T} target
 * @param {...Child} children
 * @returns {T extends string ? HTMLElement : T}
 */
export function fill(target, ...children) {
  const node = target instanceof Element ? target : byId(String(target));
  node.replaceChildren(...flattened(children));
  return /** @type {T extends string ? HTMLElement : T} */ (node);
}

/**
 * Return the element of index.html or of a panel with an id; throw if there is none of its kind.
 * @template {Element} [T=HTMLElement]
 * @param {string} id
 * @param {{ new (): T }} [kind] the element's class where it is not HTMLElement
 * @returns {T}
 */
export function byId(id, kind) {
  const node = document.getElementById(id);
  if (!(node instanceof (kind ?? HTMLElement))) throw new Error(`The page has no ${id}`);
  return /** @type {T} */ (/** @type {Element} */ (node));
}

/**
 * @param {Child[]} children
 * @returns {(Node | string)[]}
 */
function flattened(children) {
  /** @type {(Node | string)[]} */
  const nodes = [];
  for (const child of children) {
    if (Array.isArray(child)) nodes.push(...flattened(child));
    else if (child !== null && child !== undefined && child !== false) nodes.push(child);
  }
  return nodes;
}

/**
 * Contents of the icons by name, in a box of 24 by 24.
 * @type {Record<string, string>}
 */
const SHAPES = {
  play: '<path class="full" d="M7 4.5v15l12-7.5z"/>',
  pause: '<path class="full" d="M6 4.5h4v15H6zM14 4.5h4v15h-4z"/>',
  back: '<path d="M14 6l-6 6 6 6"/>',
  forth: '<path d="M10 6l6 6-6 6"/>',
  first: '<path d="M17 6l-6 6 6 6M7 6v12"/>',
  last: '<path d="M7 6l6 6-6 6M17 6v12"/>',
  close: '<path d="M6 6l12 12M18 6L6 18"/>',
  sun: [
    '<circle cx="12" cy="12" r="4"/>',
    '<path d="M12 3v2M12 19v2M3 12h2M19 12h2M5.6 5.6L7 7"/>',
    '<path d="M17 17l1.4 1.4M5.6 18.4L7 17M17 7l1.4-1.4"/>',
  ].join(""),
  moon: '<path d="M20 14.5A8.5 8.5 0 0 1 9.5 4 8.5 8.5 0 1 0 20 14.5z"/>',
  loop: [
    '<path d="M17 3l3 3-3 3M4 11V9a3 3 0 0 1 3-3h13M7 21l-3-3 3-3M20 13v2a3 3 0 0 1-3 3H4"/>',
  ].join(""),
  from: '<path d="M14 4H9v16h5"/>',
  to: '<path d="M10 4h5v16h-5"/>',
  top: '<path d="M4 8l8-4 8 4-8 4z" class="full"/><path d="M4 8v8l8 4 8-4V8M12 12v8"/>',
  front: [
    '<path d="M4 8v8l8 4v-8z" class="full"/>',
    '<path d="M4 8l8-4 8 4-8 4zM20 8v8l-8 4M12 12v8"/>',
  ].join(""),
  side: [
    '<path d="M20 8v8l-8 4v-8z" class="full"/>',
    '<path d="M4 8l8-4 8 4-8 4zM4 8v8l8 4M12 12v8"/>',
  ].join(""),
  columns: '<path d="M3 7h7v11H3zM14 7h7v11h-7z"/>',
  section: [
    '<path d="M5 19V5h9v14zM14 5l5 3v11h-5"/>',
    '<path d="M12 2v20" stroke-dasharray="2.5 2.5"/>',
  ].join(""),
  camera: '<path d="M4 8h3l2-3h6l2 3h3v11H4z"/><circle cx="12" cy="13" r="3.4"/>',
  film: '<path d="M4 5h16v14H4zM8 5v14M16 5v14M4 9.7h4M4 14.3h4M16 9.7h4M16 14.3h4"/>',
  layers: '<path d="M12 4l9 5-9 5-9-5zM3 14l9 5 9-5"/>',
  target: '<path d="M4 9V5h4M20 9V5h-4M4 15v4h4M20 15v4h-4"/><circle cx="12" cy="12" r="2.5"/>',
  plus: '<path d="M12 5v14M5 12h14"/>',
  minus: '<path d="M5 12h14"/>',
  fit: '<path d="M4 6v12M20 6v12M7 12h10M10 9l-3 3 3 3M14 9l3 3-3 3"/>',
  undo: '<path d="M8 5L4 9l4 4M4 9h10a5.5 5.5 0 0 1 0 11h-4"/>',
  redo: '<path d="M16 5l4 4-4 4M20 9H10a5.5 5.5 0 0 0 0 11h4"/>',
  split: '<path d="M12 3v18M9 8H4v8h5M15 8h5v8h-5"/>',
  add: '<path d="M4 8h9v9H4zM18 4v7M14.5 7.5h7"/>',
  bin: '<path d="M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13M10.5 11v5.5M13.5 11v5.5"/>',
  leave: '<path d="M10 4H5v16h5M14 8l4 4-4 4M18 12H9"/>',
  cloud: [
    '<g class="full"><circle cx="6" cy="7" r="1.5"/>',
    '<circle cx="12" cy="5" r="1.5"/>',
    '<circle cx="18" cy="8" r="1.5"/>',
    '<circle cx="5" cy="14" r="1.5"/>',
    '<circle cx="11" cy="12" r="1.5"/>',
    '<circle cx="18" cy="15" r="1.5"/>',
    '<circle cx="9" cy="19" r="1.5"/>',
    '<circle cx="15" cy="20" r="1.5"/>',
    "</g>",
  ].join(""),
};

/**
 * Create an icon; its size and colour come from the button around it.
 * @param {string} name
 * @returns {Element}
 */
export function icon(name) {
  const holder = document.createElement("template");
  holder.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true">${SHAPES[name]}</svg>`;
  return /** @type {Element} */ (holder.content.firstChild);
}

/**
 * Create a patch, or a short line, in the colour of a layer or model.
 * @param {string} name
 * @param {boolean} [line]
 * @returns {HTMLElement}
 */
export function swatch(name, line = false) {
  return element("i", {
    class: line ? "swatch line" : "swatch",
    style: { background: `var(--${name})` },
  });
}

/**
 * A visible warning where the data have changed since a result was made from them; else null.
 * @param {{ data_changed?: boolean | null } | null | undefined} result
 * @returns {HTMLElement | null}
 */
export const changedDataNote = (result) =>
  result?.data_changed
    ? element(
        "div",
        { class: "note-card bad", "data-changed": true },
        element("strong", {}, "The data have changed"),
        "This result was made from other files than the dataset has now. Make it again.",
      )
    : null;
