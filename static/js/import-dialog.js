// The dialog that imports a dataset: an archive, chosen or dropped on the page, or a folder on
// the server. The import is a job.
import { errorCard, post } from "./api.js";
import { element, fill } from "./dom.js";
import { upload } from "./upload.js";

const NAME = "[A-Za-z0-9][A-Za-z0-9._\\-]*";
const ARCHIVE = /\.(zip|tar|tgz|gz|bz2|xz)$/i;
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

/**
 * Take what is dropped anywhere on the page: an archive alone is imported as a dataset, unless
 * `wanted` says otherwise; all else are recordings.
 * @param {(files: File[], folders: string[]) => void} takeRecordings
 * @param {() => boolean} wanted whether archives are recordings too
 */
export function importDroppedFiles(takeRecordings, wanted) {
  window.addEventListener("dragover", (event) => {
    if (event.dataTransfer?.types.includes("Files")) event.preventDefault();
  });
  window.addEventListener("drop", (event) => {
    const folders = [...(event.dataTransfer?.items ?? [])]
      .map((item) => item.webkitGetAsEntry())
      .filter((entry) => entry?.isDirectory)
      .map((entry) => entry?.name ?? "");
    const files = [...(event.dataTransfer?.files ?? [])].filter(
      ({ name }) => !folders.includes(name),
    );
    if (!files.length && !folders.length) return;
    event.preventDefault();
    if (files.length === 1 && ARCHIVE.test(files[0].name) && !wanted()) openImportDialog(files[0]);
    else takeRecordings(files, folders);
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
            await upload(`/imports?name=${encodeURIComponent(name.value)}`, archive, (share) => {
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
export const datasetName = (file) =>
  file
    .replace(/(\.tar)?\.(zip|tar|gz|tgz|bz2|xz|bag|mcap|db3|csv|tsv|mat)$/i, "")
    .replace(/[^A-Za-z0-9._-]+/g, "-")
    .replace(/^[^A-Za-z0-9]+/, "")
    .slice(0, 64);
