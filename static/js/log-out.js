// The log-out button, for those who logged in with a token.
import { byId, fill, icon } from "./dom.js";

/** Show the log-out button to those who logged in with a token. */
export function startLogOut() {
  const form = byId("log-out");
  form.hidden = !/(^|; )palpate_inside=1/.test(document.cookie);
  if (form.firstElementChild) fill(form.firstElementChild, icon("leave"));
}
