// The dialog that imports a dataset: an archive, chosen or dropped on the page, or a folder on
// the server. The import is a job.
import { ApiError, errorCard, post } from "./api.js";
import { element, fill } from "./dom.js";

const NAME = "[A-Za-z0-9][A-Za-z0-9._\\-]*";
/** @type {HTMLDialogElement | null} */
let box = null;

/**
 * Open the dialog.
 * @param {File | null} [file] an archive that was dropped on the page
 */
export function openImportDialog(file = null) {
  box ??= document.body.appendChild(
    element("dialog", { class: "ask", "aria-label": "Import a dataset" }),
  );
  draw(box, file);
  if (!box.open) box.showModal();
}

/** Import an archive that is dropped anywhere on the page. */
export function importDroppedFiles() {
  window.addEventListener("dragover", (event) => {
    if (event.dataTransfer?.types.includes("Files")) event.preventDefault();
  });
  window.addEventListener("drop", (event) => {
    const [file] = event.dataTransfer?.files ?? [];
    if (file) {
      event.preventDefault();
      openImportDialog(file);
    }
  });
}

/**
 * @param {HTMLDialogElement} dialog
 * @param {File | null} file
 */
function draw(dialog, file) {
  const problem = element("div", { role: "alert" });
  const bar = element("i");
  const progress = element("div", { class: "progress", hidden: true }, bar);
  const name = element("input", {
    name: "name",
    required: true,
    maxlength: 64,
    pattern: NAME,
    title: "Letters, digits, dot, dash, underscore",
    autocomplete: "off",
    value: file ? datasetName(file.name) : "",
  });
  const chosen = element("input", {
    type: "file",
    name: "file",
    accept: ".zip,.tar,.gz,.tgz,.bz2,.xz",
    "aria-label": "Archive of the dataset",
  });
  chosen.addEventListener("change", () => {
    const picked = chosen.files?.[0];
    if (picked && !name.value) name.value = datasetName(picked.name);
  });
  const folder = element("input", {
    name: "folder",
    placeholder: "/data/bench/phantom-07",
    autocomplete: "off",
    "aria-label": "Folder on the server",
  });
  folder.addEventListener("input", () => {
    if (!name.dataset.own)
      name.value = datasetName(folder.value.split("/").filter(Boolean).at(-1) ?? "");
  });
  name.addEventListener("input", () => {
    name.dataset.own = "yes";
  });
  const start = element("button", { class: "button strong", type: "submit" }, "Import");
  const form = element(
    "form",
    {
      class: "ask-form",
      onsubmit: async (event) => {
        event.preventDefault();
        const archive = file ?? chosen.files?.[0] ?? null;
        fill(problem);
        if (!archive && !folder.value) {
          fill(
            problem,
            errorCard({
              kind: "Nothing chosen",
              message: "Choose an archive, or name a folder on the server.",
            }),
          );
          return;
        }
        start.disabled = true;
        progress.hidden = !archive;
        try {
          if (archive)
            await upload(archive, name.value, (share) => {
              bar.style.width = `${100 * share}%`;
            });
          else await post("/imports/folder", { folder: folder.value, name: name.value });
          dialog.close();
        } catch (refused) {
          fill(problem, errorCard(refused));
          start.disabled = false;
          progress.hidden = true;
        }
      },
    },
    file
      ? element("p", {}, `${file.name}, ${(file.size / 2 ** 20).toFixed(1)} MB`)
      : element("label", {}, "An archive of its folder (.zip, .tar, .tar.gz)", chosen),
    file ? null : element("label", {}, "or a folder on the server’s disk", folder),
    element("label", {}, "Its name here", name),
    progress,
    problem,
    element(
      "div",
      { class: "actions" },
      start,
      element(
        "button",
        { class: "button", type: "button", onclick: () => dialog.close() },
        "Cancel",
      ),
    ),
  );
  fill(
    dialog,
    element("h1", { class: "verdict" }, "Import a dataset"),
    element(
      "p",
      { class: "gain-note" },
      "Every file is checked first: the dataset is taken as a whole, " +
        "or refused with all that is wrong with it.",
    ),
    form,
  );
}

/**
 * Return a valid dataset name from the name of a file or folder.
 * @param {string} file
 * @returns {string}
 */
const datasetName = (file) =>
  file
    .replace(/(\.tar)?\.(zip|tar|gz|tgz|bz2|xz)$/i, "")
    .replace(/[^A-Za-z0-9._-]+/g, "-")
    .replace(/^[^A-Za-z0-9]+/, "")
    .slice(0, 64);

/**
 * Send a file with XMLHttpRequest, because fetch does not report progress.
 * @param {File} file
 * @param {string} name
 * @param {(share: number) => void} onProgress
 * @returns {Promise<unknown>}
 */
function upload(file, name, onProgress) {
  return new Promise((done, refused) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/api/imports?name=${encodeURIComponent(name)}`);
    request.setRequestHeader("content-type", "application/octet-stream");
    request.upload.onprogress = ({ loaded, total }) => onProgress(total ? loaded / total : 0);
    request.onload = () => {
      let body = { kind: "Error", message: `The server answered ${request.status}.`, where: {} };
      try {
        body = JSON.parse(request.responseText);
      } catch {
        // The message above is shown.
      }
      if (request.status < 300) done(body);
      else refused(new ApiError(body));
    };
    request.onerror = () =>
      refused(
        new ApiError({
          kind: "No answer",
          message: "The connection broke while sending; try again.",
          where: {},
        }),
      );
    request.send(file);
  });
}
