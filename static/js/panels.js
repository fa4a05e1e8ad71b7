// The panels on the right side and their tabs. The report is the first.
import { byId, element, fill } from "./dom.js";

/**
 * @type {{ id: string, label: string, box: HTMLElement, opened: ((box: HTMLElement) => unknown) |
 *   null, left: (() => unknown) | null }[]}
 */
const panels = [
  {
    id: "report",
    label: "Report",
    box: byId("panel"),
    opened: null,
    left: null,
  },
];
let current = "report";

/**
 * Add a panel with its tab.
 * @param {string} id
 * @param {string} label
 * @param {(box: HTMLElement) => unknown} opened called with the panel's element each time it
 *   comes to the front; fills it
 * @param {(() => unknown) | null} [left] called when another panel comes to the front
 * @returns {HTMLElement}
 */
export function addPanel(id, label, opened, left = null) {
  const box = element("div", {
    id: `panel-${id}`,
    class: "panel",
    role: "tabpanel",
    "aria-label": label,
    tabindex: "-1",
    hidden: true,
  });
  byId("panel").after(box);
  panels.push({ id, label, box, opened, left });
  draw();
  return box;
}

/**
 * Bring a panel to the front.
 * @param {string} id
 */
export function openPanel(id) {
  const next = panels.find((panel) => panel.id === id);
  if (!next) return;
  if (id !== current) panels.find((panel) => panel.id === current)?.left?.();
  current = id;
  for (const panel of panels) panel.box.hidden = panel !== next;
  draw();
  next.opened?.(next.box);
}

/** Return the id of the panel in front. */
export const openedPanel = () => current;

function draw() {
  const tabs = fill(
    "tabs",
    panels.map(({ id, label, box }) =>
      element(
        "button",
        {
          type: "button",
          role: "tab",
          id: `tab-${id}`,
          "aria-selected": String(id === current),
          "aria-controls": box.id,
          onclick: () => openPanel(id),
        },
        label,
      ),
    ),
  );
  tabs.hidden = panels.length < 2;
}
