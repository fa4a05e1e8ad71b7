// Sending of files, with progress and an end.
import { ApiError } from "./api.js";

/**
 * Send a file as the body of a request with XMLHttpRequest, because fetch does not report
 * progress; returns the answer.
 * @param {string} path below /api
 * @param {File} file
 * @param {(share: number) => void} onProgress
 * @param {AbortSignal | null} [signal] ends the sending
 * @returns {Promise<any>}
 */
export function upload(path, file, onProgress, signal = null) {
  return new Promise((done, refused) => {
    const request = new XMLHttpRequest();
    /**
     * @param {string} kind
     * @param {string} message
     */
    const fail = (kind, message) => refused(new ApiError({ kind, message, where: {} }));
    request.open("POST", `/api${path}`);
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
    request.onerror = () => fail("No answer", "The connection broke while sending; try again.");
    request.onabort = () => fail("Cancelled", "The sending was cancelled.");
    signal?.addEventListener("abort", () => request.abort());
    request.send(file);
  });
}
