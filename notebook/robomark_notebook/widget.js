// Shows a replay in a notebook. The component's texts and files come before this file.

async function render({ model, el }) {
  const report = element("div");
  const root = element("div", { className: "component" });
  const section = element("section", { className: "replay" }, root);
  const frame = element("div", { className: "robomark" }, report, section);
  // Otherwise Jupyter takes the keys for its own. It asks the element with the focus before those around it.
  frame.addEventListener("focusin", ({ target }) => target.setAttribute("data-lm-suppress-shortcuts", "true"));
  report.innerHTML = model.get("report"); // escaped where it is made
  el.append(frame);
  try {
    const bytes = model.get("replay");
    const controls = bytes.byteLength ? await showReplay(await unpack(bytes), root) : null;
    section.hidden = !controls;
    if (controls) adaptToOutput(frame, controls);
    frame.dataset.ready = "true";
  } catch (error) {
    root.replaceChildren(element("p", {}, say("cannotBeShown", { error: error.message })));
  }
}

// Links to moments move the replay of this output, and not the page. An output has little room.
function adaptToOutput(frame, controls) {
  controls.link.hidden = true;
  frame.querySelector(".all-readings").open = false;
  for (const button of frame.querySelectorAll("button.watch")) button.hidden = false;
  frame.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#'], button.watch");
    if (!link) return;
    event.preventDefault();
    controls.follow(link.dataset.moment ?? link.hash);
  });
}

export default { render };
