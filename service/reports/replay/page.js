// Starts the replays of a page, also those in parts that are loaded later. The page has their data and texts; links to
// moments change the page's address.

let knownWords = null;

// Returns the texts. All replays of a page have the same, and a page can get its first replay later.
function words() {
  knownWords ??= JSON.parse(document.querySelector("section.replay > script").textContent).words;
  return knownWords;
}

// Follows links of the page until the replay is removed from it, for example for that of the next run.
function followAddress(controls) {
  const removal = new AbortController();
  const follow = (hash) => {
    if (controls.root.isConnected) controls.follow(hash);
    else removal.abort();
  };
  window.addEventListener("hashchange", () => follow(location.hash), { signal: removal.signal });
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element && event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) follow(link.hash);
  }, { signal: removal.signal });
  controls.follow(location.hash);
}

async function startReplay(section) {
  section.dataset.started = "";
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

// Starts the replays that have not started yet. In a part that htmx loads, they are in templates, because htmx removes
// scripts, also those with data.
function startReplays() {
  document.querySelectorAll("template.replay").forEach((template) => template.replaceWith(template.content));
  document.querySelectorAll("section.replay:not([data-started])").forEach(startReplay);
}

startReplays();
document.addEventListener("htmx:load", startReplays);
