// The help dialog: a tutorial from the import to a sweep and an accepted registration, and all
// keys.
import { byId, element, fill, icon } from "./dom.js";
import { bindShortcuts } from "./shortcuts.js";
import { CUT_SHORTCUTS } from "./look-timeline-keys.js";
import { REGISTER_SHORTCUTS as REGISTER } from "./register-shortcuts.js";

/**
 * Keys and what they do.
 * @type {string[][]}
 */
const PAGE = [
  ["?", "this help"],
  ["Space", "play or pause"],
  ["← →", "one frame back or on; with Shift ten"],
  ["Home, End", "first, last frame"],
  ["I, O", "loop from, to this frame"],
  ["L", "loop on or off"],
  ["0 1 2 3", "look from the side of the camera, the top, the front, the side"],
  ["B", "models side by side"],
  ["X", "cut the phantom open"],
  ["Ctrl Z", "undo, in What if, Register and Import"],
  ["Tab, Enter", "reach and press every control"],
];

/**
 * @param {string} text
 * @returns {HTMLElement}
 */
const code = (text) => element("code", {}, text);

/**
 * Titles and paragraphs of the tutorial.
 * @type {[string, HTMLElement[]][]}
 */
const STEPS = [
  [
    "Import a dataset",
    [
      element(
        "p",
        {},
        "No data at hand? ",
        code("make demo"),
        " made a phantom with a hidden fault, and opened this page on it: it stands under " +
          "Datasets. Of your own, press ",
        element("b", {}, "Import …"),
        " there and choose what the bench recorded: bags, tables, folders of clouds. Look at " +
          "them: streams and their roles, clouds, tool and forces over time, where each push " +
          "begins and ends. Correct what you know better, name the dataset and import it. A " +
          "dataset that is finished comes as an archive, or as a folder on the server’s disk.",
      ),
      element(
        "p",
        {},
        "Then choose the dataset on the left: what it holds, what is doubtful, and what it " +
          "cannot tell.",
      ),
    ],
  ],
  [
    "Register the camera by hand",
    [
      element(
        "p",
        {},
        "Open ",
        element("b", {}, "Register"),
        ". The rest cloud stands beside the phantom, from whatever start. Click a corner on " +
          "the cloud, then the same corner on the phantom (near a landmark the click is the " +
          "landmark). Drag with the mouse turns the view, the wheel zooms.",
      ),
      element(
        "p",
        {},
        "After three pairs the list shows what each pair misses by; a millimetre or two is " +
          "usual. What does not fit is said at the pair: mirrored, in one line, clicked twice. " +
          "Choose an end to move it: click anew, drag it, or press arrow keys.",
      ),
      element(
        "p",
        {},
        "Press ",
        element("b", {}, "Refine by ICP"),
        " (Enter): the residual before and after, and the directions that the cloud " +
          "determines weakly, as arrows. ",
        element("b", {}, "Accept"),
        " keeps it under a name; ",
        element("b", {}, "Back to the pairs"),
        " does not.",
      ),
    ],
  ],
  [
    "Sweep a parameter",
    [
      element(
        "p",
        {},
        "Open ",
        element("b", {}, "Sweep"),
        ", choose the dataset, a parameter and its range; for a first look take 5 steps and " +
          "4 clouds of each sequence. Under Camera choose the registration you accepted. ",
        element("b", {}, "Start the sweep"),
        ": points appear as they end.",
      ),
      element(
        "p",
        {},
        "At the end the least error and its place stand on top. A parameter along which the " +
          "error does not change beyond chance is called flat: these clouds cannot tell it. " +
          "Stop at any time; Resume goes on.",
      ),
    ],
  ],
  [
    "Find the cause",
    [
      element(
        "p",
        {},
        "Choose the dataset and press ",
        element("b", {}, "Diagnose"),
        ": minutes later the verdict, its evidence, the gain on sequences nothing was fitted " +
          "on, and what to measure next. ",
        element("b", {}, "What if"),
        " lets you switch causes on and off on the frame that is shown.",
      ),
    ],
  ],
  [
    "Take results away",
    [
      element(
        "p",
        {},
        element("b", {}, "Save as one file"),
        " in a report, or ",
        element("b", {}, "Export"),
        " for model and replays. Everything here is also REST (",
        element("a", { href: "/openapi.json", target: "_blank" }, "description"),
        "), Python (",
        code("app.client.Client"),
        ") and terminal (",
        code("palpate --help"),
        ").",
      ),
    ],
  ],
];

/** Create the dialog; the help button and "?" open it. */
export function startHelp() {
  const dialog = document.body.appendChild(
    element("dialog", { id: "help", class: "ask help", "aria-label": "Help" }),
  );
  /** @param {string[][]} keys */
  const list = (keys) =>
    element(
      "dl",
      { class: "keys" },
      keys.flatMap(([key, what]) => [element("dt", {}, key), element("dd", {}, what)]),
    );
  fill(
    dialog,
    element(
      "button",
      {
        class: "icon-button close",
        type: "button",
        title: "Close (Esc)",
        onclick: () => dialog.close(),
      },
      icon("close"),
    ),
    element(
      "h1",
      { class: "verdict" },
      "From nothing to a sweep and a registration in ten minutes",
    ),
    element(
      "ol",
      { class: "steps" },
      STEPS.map(([title, parts]) => element("li", {}, element("h2", {}, title), parts)),
    ),
    element(
      "div",
      { class: "key-lists" },
      element("section", {}, element("h2", {}, "Keys everywhere"), list(PAGE)),
      element("section", {}, element("h2", {}, "Keys in Register"), list(REGISTER)),
      element("section", {}, element("h2", {}, "Keys in Import"), list(CUT_SHORTCUTS)),
    ),
  );
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  const open = () => {
    if (!dialog.open) dialog.showModal();
    dialog.scrollTop = 0;
  };
  const button = byId("help-button");
  fill(button, "?").addEventListener("click", open);
  bindShortcuts({ "?": open });
}
