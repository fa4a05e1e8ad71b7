// Before anything is drawn: the remembered theme, else the system's.
(() => {
  const stored = localStorage.getItem("palpate.theme");
  const dark = stored ? stored === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
})();
