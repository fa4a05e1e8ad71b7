// Requests to the server, and messages for failed ones.
import { byId, element } from "./dom.js";

/** @import { ServerError } from "./types.js" */

/** An error with the server's sentence on what to do; `where` names file, row, key or value. */
export class ApiError extends Error {
  /** @param {ServerError} error */
  constructor({ kind, message, where }) {
    super(message);
    this.kind = kind;
    this.where = where;
  }
}

/**
 * Send GET to a path below /api and return the answer.
 * @param {string} path
 * @returns {Promise<any>}
 */
export async function get(path) {
  return parsed(await request(path));
}

/**
 * Send POST with a JSON body and return the answer.
 * @param {string} path
 * @param {unknown} [body]
 * @returns {Promise<any>}
 */
export async function post(path, body) {
  return parsed(
    await request(path, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body ?? {}),
    }),
  );
}

/**
 * Send PUT with a JSON body.
 * @param {string} path
 * @param {unknown} body
 */
export async function put(path, body) {
  const response = await request(path, {
    method: "PUT",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
  });
  if (!response.ok) await parsed(response);
}

/**
 * Send DELETE.
 * @param {string} path
 */
export async function remove(path) {
  const response = await request(path, { method: "DELETE" });
  if (!response.ok) await parsed(response);
}

/**
 * Send a request; throw an ApiError if the server cannot be reached.
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<Response>}
 */
async function request(path, options) {
  try {
    return await fetch(`/api${path}`, options);
  } catch {
    throw new ApiError({
      kind: "No answer",
      message: "The server does not answer. Start it again with: palpate serve",
      where: {},
    });
  }
}

/**
 * Parse an answer; throw an ApiError if it is one. Without a login the browser goes to the login
 * page.
 * @param {Response} response
 * @returns {Promise<any>}
 */
async function parsed(response) {
  const body = await response.json().catch(() => ({
    kind: "Error",
    message: `The server answered ${response.status}.`,
    where: {},
  }));
  if (response.status === 401) location.assign("/login");
  if (!response.ok) throw new ApiError(body);
  return body;
}

/**
 * Show an error in a corner of the page for 9 s.
 * @param {unknown} error
 */
export function toast(error) {
  const problem = toError(error);
  const box = element(
    "div",
    { class: "toast" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );
  byId("toasts").append(box);
  setTimeout(() => box.remove(), 9000);
}

/**
 * Return the kind of an error as a title: "RunError" becomes "Run".
 * @param {ServerError} problem
 * @returns {string}
 */
export function errorTitle(problem) {
  return (
    (problem.kind ?? "Error").replace(/Error$/, "").replace(/([a-z])([A-Z])/g, "$1 $2") || "Error"
  );
}

/**
 * Return what a catch clause received as an error with a message.
 * @param {unknown} error
 * @returns {ServerError & { name?: string }}
 */
export function toError(error) {
  if (error instanceof Error) return error;
  const { message, ...rest } = /** @type {Partial<ServerError>} */ (error ?? {});
  return { ...rest, message: message ?? String(error) };
}

/**
 * Create a card with an error's title and message.
 * @param {unknown} error
 * @returns {HTMLElement}
 */
export function errorCard(error) {
  const problem = toError(error);
  return element(
    "div",
    { class: "note-card bad", role: "alert" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );
}
