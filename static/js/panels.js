// The right side: one panel for each thing that is done, a tab for each, the report first.
import { element, fill } from "./dom.js";

const panels = [
  {
    id: "report",
    label: "Report",
    box: document.getElementById("panel"),
    opened: null,
    left: null,
  },
];
let current = "report";

/**
 * A further panel with its tab.
 * @param opened called with the panel's element whenever it comes to the front; fills it.
 * @param left called when another comes to the front.
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
  document.getElementById("panel").parentElement.append(box);
  panels.push({ id, label, box, opened, left });
  draw();
  return box;
}

/** Bring a panel to the front. */
export function openPanel(id) {
  const wanted = panels.find((panel) => panel.id === id);
  if (!wanted) return;
  if (id !== current) panels.find((panel) => panel.id === current).left?.();
  current = id;
  for (const panel of panels) panel.box.hidden = panel.id !== id;
  draw();
  wanted.opened?.(wanted.box);
}

/** Which panel is in front. */
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
