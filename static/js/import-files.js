// First step of an import: recordings that are sent to the server or lie there, and earlier looks.
import { element, icon } from "./dom.js";

/** @import { ImportActions, ImportFile, ImportView } from "./types.js" */

let typedPath = ""; // that was not added yet

/**
 * Draw the step: all of it before a look, one line with what was looked at after.
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @param {HTMLElement | null} problem
 * @returns {HTMLElement}
 */
export function filesSection(view, actions, problem) {
  const { look } = view;
  if (look)
    return element(
      "section",
      { class: "import-step", "aria-label": "Recordings" },
      element(
        "h2",
        {},
        look.source.kind === "dataset" ? "Dataset" : "Recordings",
        element(
          "button",
          { class: "link", type: "button", "data-key": "over", onclick: actions.startOver },
          "Look at something else",
        ),
      ),
      element(
        "p",
        { class: "import-names" },
        look.source.kind === "dataset"
          ? look.source.name
          : look.source.files.map(lastPart).join(", ") || look.source.name,
      ),
      problem,
    );
  return element(
    "section",
    { class: "import-step", "aria-label": "Recordings" },
    element("h2", {}, "1  Recordings"),
    dropZone(actions),
    view.files.length
      ? element(
          "ul",
          { class: "import-files", "aria-label": "Chosen files" },
          view.files.map((file) => fileRow(file, actions)),
        )
      : null,
    pathForm(actions),
    problem,
    view.job ? null : lookButton(view, actions),
    element(
      "p",
      { class: "import-hint" },
      "A dataset that is finished already? ",
      element(
        "button",
        { class: "link", type: "button", onclick: actions.bringArchive },
        "Bring its archive or folder",
      ),
    ),
    earlier(view, actions),
  );
}

/**
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function dropZone(actions) {
  const input = element("input", {
    type: "file",
    name: "recordings",
    multiple: true,
    "aria-label": "Recordings",
    "data-key": "recordings",
  });
  input.addEventListener("change", () => {
    actions.addFiles([...(input.files ?? [])]);
    input.value = "";
  });
  return element(
    "label",
    { class: "drop-zone" },
    input,
    element("b", {}, "Choose files, or drop them on the page"),
    element(
      "small",
      {},
      "Bags (.bag, .mcap, .db3), tables (.csv, .tsv, .mat), folders packed as .zip, and beside " +
        "them touches.csv, traces.csv, rest.ply and dataset.toml.",
    ),
  );
}

/**
 * @param {ImportFile} file
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function fileRow({ key, name, size, share, token, problem }, actions) {
  const state = problem
    ? problem
    : token === null
      ? `${Math.round(100 * share)} % of ${formatBytes(size)}`
      : size === null
        ? "on the server"
        : formatBytes(size);
  const cancel = token === null && !problem;
  return element(
    "li",
    { "data-file": name, "data-state": problem ? "failed" : cancel ? "sending" : "there" },
    element(
      "div",
      { class: "head" },
      element("span", { class: "name", title: name }, name),
      element(
        "span",
        { class: problem ? "value bad" : "value", role: problem ? "alert" : null },
        state,
      ),
      element(
        "button",
        {
          class: "icon-button",
          type: "button",
          title: cancel ? `Cancel ${name}` : `Leave ${name} out`,
          "aria-label": cancel ? `Cancel ${name}` : `Leave ${name} out`,
          onclick: () => actions.removeFile(key),
        },
        icon("close"),
      ),
    ),
    cancel
      ? element(
          "div",
          {
            class: "progress",
            role: "progressbar",
            "aria-label": `Sending ${name}`,
            "aria-valuemin": 0,
            "aria-valuemax": 100,
            "aria-valuenow": Math.round(100 * share),
          },
          element("i", { style: { width: `${100 * share}%` } }),
        )
      : null,
  );
}

/**
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function pathForm(actions) {
  const path = element("input", {
    name: "path",
    placeholder: "/data/bench/monday.bag",
    autocomplete: "off",
    "aria-label": "Path on the server’s disk",
    "data-key": "path",
    value: typedPath,
    oninput: ({ target }) => {
      typedPath = target.value;
    },
  });
  return element(
    "form",
    {
      class: "import-path",
      onsubmit: (event) => {
        event.preventDefault();
        const given = path.value.trim();
        typedPath = path.value = "";
        if (given) actions.addPath(given);
      },
    },
    element("label", {}, "or a file or folder on the server’s disk", path),
    element("button", { class: "button", type: "submit" }, "Add"),
  );
}

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @returns {HTMLElement}
 */
function lookButton({ files }, actions) {
  const waiting = files.some(({ token, problem }) => token === null && !problem);
  const ready = files.some(({ token }) => token !== null);
  return element(
    "div",
    { class: "actions" },
    element(
      "button",
      {
        class: "button strong",
        type: "button",
        "data-key": "look",
        disabled: waiting || !ready,
        title: waiting ? "The files are being sent" : ready ? null : "Choose a recording first",
        onclick: actions.startLook,
      },
      "Look at them",
    ),
  );
}

/**
 * @param {ImportView} view
 * @param {ImportActions} actions
 * @returns {HTMLElement | null}
 */
function earlier({ looks }, actions) {
  const finished = looks.filter(({ source }) => source !== null).slice(0, 8);
  if (!finished.length) return null;
  return element(
    "section",
    { "aria-label": "Earlier looks" },
    element("h2", {}, "Earlier looks"),
    element(
      "ul",
      { class: "import-files" },
      finished.map(({ id, source }) => {
        const name = source?.name || id;
        const from = (source?.files ?? []).map(lastPart).join(", ");
        return element(
          "li",
          {},
          element(
            "div",
            { class: "head" },
            element(
              "button",
              {
                class: "link name",
                type: "button",
                title: from,
                onclick: () => actions.openLook(id),
              },
              name,
            ),
            element("span", { class: "value" }, source?.kind === "dataset" ? "dataset" : from),
            element(
              "button",
              {
                class: "icon-button",
                type: "button",
                title: `Delete the look at ${name}`,
                "aria-label": `Delete the look at ${name}`,
                onclick: () => actions.removeLook(id),
              },
              icon("bin"),
            ),
          ),
        );
      }),
    ),
  );
}

/**
 * @param {string} path
 * @returns {string}
 */
export const lastPart = (path) => path.split("/").filter(Boolean).at(-1) ?? path;

/**
 * @param {number | null} bytes
 * @returns {string}
 */
function formatBytes(bytes) {
  const size = bytes ?? 0;
  if (size < 1e6) return `${(size / 1e3).toFixed(size < 1e4 ? 1 : 0)} kB`;
  return size < 1e9 ? `${(size / 1e6).toFixed(1)} MB` : `${(size / 1e9).toFixed(2)} GB`;
}
