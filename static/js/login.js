// Says on the login page why the last token was refused; the reason is the address's query.
/** @type {Record<string, string>} */
const REASONS = {
  "?wrong":
    "This is not the token that palpate serve printed; palpate serve --new-token makes another.",
  "?wait": "Too many wrong tokens: wait a minute, then try again.",
};
const box = document.getElementById("problem");
if (box) box.textContent = REASONS[location.search] ?? "";
