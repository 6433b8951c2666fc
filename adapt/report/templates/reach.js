// Support for keyboard and print.

// Make scrollable parts reachable by Tab where their content overflows.
function reachScrollers() {
  document.querySelectorAll(".scroll").forEach((one) => {
    const scrolls = one.scrollWidth > one.clientWidth || one.scrollHeight > one.clientHeight;
    if (!scrolls) return ["tabindex", "role", "aria-label"].forEach((name) => one.removeAttribute(name));
    one.tabIndex = 0;
    one.setAttribute("role", "group");
    one.setAttribute("aria-label", `table: ${one.closest("section").querySelector("h2").textContent.trim()}`);
  });
}

// Draw the charts as wide as the paper, and the 3-D view as an image, because its canvas prints empty.
function toPaper() {
  const { scene } = element("view")._fullLayout;
  if (scene) element("printed-view").src = scene._scene.toImage();
  document.body.classList.add("paper");
  go({ model: at.model });
}

function toScreen() {
  document.body.classList.remove("paper");
  go({ model: at.model });
}

window.addEventListener("beforeprint", toPaper);
window.addEventListener("afterprint", toScreen);
let wasNarrow = narrow();
window.addEventListener("resize", () => {
  reachScrollers();
  if (narrow() === wasNarrow) return;
  wasNarrow = narrow();
  go({ model: at.model });
});
document.addEventListener("keydown", ({ key, target }) => {
  if (key === "Escape" && target.matches("abbr")) target.blur(); // hides the explanation
});
