// The files of an import on their way to the server.
import { toError } from "./api.js";
import { upload } from "./upload.js";

/** @import { ImportFile, ImportView } from "./types.js" */

/**
 * Return the functions that change the list of files of a view; files are sent one after the other.
 * @param {ImportView} view
 * @param {() => void} redraw
 */
export function createFileList(view, redraw) {
  let keys = 0;
  let sending = Promise.resolve();

  /**
   * @param {string} name
   * @param {Partial<ImportFile>} more
   * @returns {ImportFile}
   */
  function put(name, more) {
    /** @type {ImportFile} */
    const file = {
      key: ++keys,
      name,
      size: null,
      share: 0,
      token: null,
      problem: null,
      cancel: null,
      ...more,
    };
    view.files = [...view.files.filter((other) => other.name !== name || !other.problem), file];
    view.problem = null;
    return file;
  }

  /**
   * @param {ImportFile} row
   * @param {File} file
   * @param {AbortSignal} signal
   */
  async function send(row, file, signal) {
    if (signal.aborted) return;
    try {
      const path = `/uploads?file=${encodeURIComponent(file.name)}`;
      const answer = await upload(
        path,
        file,
        (share) => {
          row.share = share;
          redraw();
        },
        signal,
      );
      row.token = answer.file;
    } catch (problem) {
      if (!signal.aborted) row.problem = toError(problem).message;
    }
    redraw();
  }

  return {
    /**
     * @param {Iterable<File>} files
     * @param {string[]} [folders] names of folders, which cannot be sent
     */
    add: (files, folders = []) => {
      for (const folder of folders)
        put(folder, { problem: "a folder: pack it as .zip, or name its path below" });
      for (const file of files) {
        const control = new AbortController();
        const row = put(file.name, { size: file.size, cancel: () => control.abort() });
        sending = sending.then(() => send(row, file, control.signal));
      }
      redraw();
    },
    /** @param {string} path */
    addPath: (path) => {
      put(path, { token: path, share: 1 });
      redraw();
    },
    /** @param {number} key */
    remove: (key) => {
      view.files.find((file) => file.key === key)?.cancel?.();
      view.files = view.files.filter((file) => file.key !== key);
      redraw();
    },
  };
}
