// Requests to our own server; a problem is shown with what it says to do.
import { element } from "./dom.js";

export class ApiError extends Error {
  constructor({ kind, message, where }) {
    super(message);
    Object.assign(this, { kind, where });
  }
}

export async function get(path) {
  return parsed(await request(path));
}

export async function post(path, body) {
  return parsed(
    await request(path, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body ?? {}),
    }),
  );
}

export async function put(path, body) {
  const response = await request(path, {
    method: "PUT",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
  });
  if (!response.ok) await parsed(response);
}

export async function remove(path) {
  const response = await request(path, { method: "DELETE" });
  if (!response.ok) await parsed(response);
}

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

export function toast(problem) {
  const box = element(
    "div",
    { class: "toast" },
    element("strong", {}, errorTitle(problem)),
    problem.message,
  );
  document.getElementById("toasts").append(box);
  setTimeout(() => box.remove(), 9000);
}

export function errorTitle(problem) {
  return (
    (problem.kind ?? "Error").replace(/Error$/, "").replace(/([a-z])([A-Z])/g, "$1 $2") || "Error"
  );
}
