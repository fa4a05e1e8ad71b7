// Keys of the whole page, in one place: parts bind theirs, whoever has the focus outside a field hears them.
const actions = {};

/** Bind keys to actions, which get the event; a key has one action. */
export function bindShortcuts(keys) {
  Object.assign(actions, keys);
}

export function handleShortcut(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in actions)) return;
  const typing = event.target?.matches?.(
    "input:not(#scrub):not([type=checkbox]), select, textarea",
  );
  const pressing =
    event.key === " " && event.target?.matches?.("button, input[type=checkbox], summary");
  if (typing || pressing || document.querySelector("dialog[open]")) return;
  event.preventDefault();
  event.stopPropagation();
  actions[event.key](event);
}
