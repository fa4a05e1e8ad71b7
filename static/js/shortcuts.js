// Keyboard shortcuts of the whole page: modules bind theirs here.
/** @type {Record<string, (event: KeyboardEvent) => void>} */
const actions = {};

/**
 * Bind keys, named as in KeyboardEvent.key, to actions. A key has one action.
 * @param {Record<string, (event: KeyboardEvent) => void>} keys
 */
export function bindShortcuts(keys) {
  Object.assign(actions, keys);
}

/**
 * Run the action of a pressed key, unless a field, a dialog or a button needs the key itself.
 * @param {KeyboardEvent} event
 */
export function handleShortcut(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in actions)) return;
  const target = /** @type {Element | null} */ (event.target);
  const typing = target?.matches?.("input:not(#scrub):not([type=checkbox]), select, textarea");
  const pressing = event.key === " " && target?.matches?.("button, input[type=checkbox], summary");
  if (typing || pressing || document.querySelector("dialog[open]")) return;
  event.preventDefault();
  event.stopPropagation();
  actions[event.key](event);
}
