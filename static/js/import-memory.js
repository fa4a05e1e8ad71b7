// What the page remembers of looks over a reload: how they were asked for, and what was changed by
// hand since.
/** @import { CutSequence, ImportSetup, LookRequest } from "./types.js" */

const KEY = "palpate.looks";
const MOST = 8;

/**
 * @typedef {object} Remembered
 * @property {LookRequest} [request]
 * @property {ImportSetup} [setup]
 * @property {Record<string, string>} [meaning]
 * @property {CutSequence[]} [sequences]
 * @property {string} [name]
 */

/** @returns {[string, Remembered][]} the newest last */
function readAll() {
  try {
    const all = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(all) ? all : [];
  } catch {
    return [];
  }
}

/**
 * Return what is remembered of a look.
 * @param {string} id
 * @returns {Remembered}
 */
export const remembered = (id) => readAll().find(([one]) => one === id)?.[1] ?? {};

/**
 * Remember more of a look; the oldest looks are forgotten.
 * @param {string} id
 * @param {Remembered} more
 */
export function remember(id, more) {
  const all = readAll();
  const now = { ...all.find(([one]) => one === id)?.[1], ...more };
  const next = [...all.filter(([one]) => one !== id), [id, now]].slice(-MOST);
  localStorage.setItem(KEY, JSON.stringify(next));
}

/** @param {string} id */
export function forget(id) {
  localStorage.setItem(KEY, JSON.stringify(readAll().filter(([one]) => one !== id)));
}

/**
 * Put the look into the page's address, or take it out.
 * @param {string | null} id
 */
export function addressOf(id) {
  const address = new URL(location.href);
  if (id) address.searchParams.set("look", id);
  else address.searchParams.delete("look");
  history.replaceState(null, "", address);
}
