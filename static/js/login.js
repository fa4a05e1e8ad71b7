// Says why the last token was refused; the reason is all that the address carries.
const REASONS = {
  "?wrong":
    "This is not the token that palpate serve printed; palpate serve --new-token makes another.",
  "?wait": "Too many wrong tokens: wait a minute, then try again.",
};
document.getElementById("problem").textContent = REASONS[location.search] ?? "";
