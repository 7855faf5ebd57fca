// Starts the replay of a report's page. The page has its data and texts; links to moments change the page's address.

const WORDS = wordsOf(document.querySelector("section.replay > script"));

function wordsOf(island) {
  return island ? JSON.parse(island.textContent).words : null;
}

function followAddress(controls) {
  window.addEventListener("hashchange", () => controls.follow(location.hash));
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element && event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) controls.follow(link.hash);
  });
  controls.follow(location.hash);
}

async function startReplay(section) {
  const root = section.querySelector(".component");
  try {
    const { deflated } = JSON.parse(section.querySelector("script").textContent);
    const replay = await unpack(Uint8Array.from(atob(deflated), (character) => character.charCodeAt(0)));
    const controls = await showReplay(replay, root);
    if (controls) followAddress(controls);
    section.dataset.ready = String(Math.round(performance.now()));
  } catch (error) {
    root.replaceChildren(element("p", {}, say("cannotBeShown", { error: error.message })));
  }
}

document.querySelectorAll("section.replay").forEach(startReplay);
