// Sets the stored theme, or else the system's, before anything is drawn.
(() => {
  const stored = localStorage.getItem("palpate.theme");
  const dark = stored ? stored === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
})();
