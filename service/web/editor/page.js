// The editors of a page: links to lines, errors of a run, other texts to start from, and unsaved text.

import { Editor } from "./editor.js";

const fields = [...document.querySelectorAll("textarea.code")];
const editors = fields.map((field) => new Editor(field, () => document.querySelector("[data-run]")?.click()));
let savedTexts = textsNow();

function textsNow() {
  return JSON.stringify(editors.map((editor) => editor.text));
}

function announce(text) {
  document.getElementById("run-status").textContent = text;
}

// Marks the errors that the page lists with links to lines of the editors.
function markErrors() {
  const links = [...document.querySelectorAll("a[data-line]")];
  for (const editor of editors) {
    editor.markErrors(links.filter((link) => link.dataset.file === editor.file)
      .map((link) => ({ line: Number(link.dataset.line), message: link.dataset.message })));
  }
}

// Loads the texts of another page of the same form. Undo restores the previous ones.
async function load(link) {
  const answer = await fetch(link.href);
  if (!answer.ok || answer.redirected) throw new Error(answer.statusText);
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  for (const editor of editors) editor.replace(page.getElementById(editor.field.id).value);
  savedTexts = textsNow();
  // The errors are those of another program.
  for (const error of document.querySelectorAll("a[data-line]")) error.replaceWith(error.textContent);
  document.querySelector("a[data-load][aria-current]")?.removeAttribute("aria-current");
  link.setAttribute("aria-current", "true");
  announce(link.dataset.loaded);
}

document.addEventListener("click", (event) => {
  const link = event.target instanceof Element && event.target.closest("a[data-line], a[data-load]");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  if ("load" in link.dataset) {
    event.preventDefault();
    load(link).catch(() => { location.href = link.href; });
    return;
  }
  const editor = editors.find((each) => each.file === link.dataset.file);
  if (!editor) return;
  event.preventDefault();
  editor.goToLine(Number(link.dataset.line));
});
document.addEventListener("htmx:load", (event) => {
  if (event.target.closest("#result")) markErrors();
});
markErrors();

// A new run. The server has the text from now on, as after a submission. The address can name a moment of the old replay.
document.addEventListener("htmx:beforeRequest", (event) => {
  if (!event.target.matches("[data-run]")) return;
  savedTexts = textsNow();
  history.replaceState(null, "", location.pathname + location.search);
  announce(event.target.dataset.started);
});
document.addEventListener("htmx:afterRequest", (event) => {
  if (event.target.matches("[data-run]")) document.getElementById("run-failed").hidden = event.detail.successful;
});
document.addEventListener("submit", () => { savedTexts = textsNow(); });
window.addEventListener("beforeunload", (event) => {
  if (textsNow() !== savedTexts) event.preventDefault();
});
// The browser restores the fields of a page that the reader comes back to.
window.addEventListener("pageshow", () => {
  for (const editor of editors) if (editor.field.value !== editor.text) editor.replace(editor.field.value);
});
