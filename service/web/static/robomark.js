"use strict";
// Buttons that copy what a field has; without this the field can be selected.
for (const button of document.querySelectorAll("[data-copies]")) {
  const field = document.getElementById(button.dataset.copies);
  button.hidden = false;
  button.addEventListener("click", async () => {
    field.select();
    try {
      await navigator.clipboard.writeText(field.value);
    } catch {
      document.execCommand("copy");
    }
    button.textContent = button.dataset.copied;
  });
}
// The way back to a form keeps what was typed; without this the browser's own does.
for (const back of document.querySelectorAll("[data-back]")) {
  back.hidden = history.length < 2;
  back.addEventListener("click", () => history.back());
}
// Files that are dropped on an upload's place become the ones of its field; without this the field itself works.
for (const place of document.querySelectorAll(".drop")) {
  const field = place.querySelector("input[type=file]");
  for (const name of ["dragenter", "dragover"]) {
    place.addEventListener(name, (event) => { event.preventDefault(); place.classList.add("over"); });
  }
  place.addEventListener("dragleave", () => place.classList.remove("over"));
  place.addEventListener("drop", (event) => {
    event.preventDefault();
    place.classList.remove("over");
    field.files = event.dataTransfer.files;
    field.dispatchEvent(new Event("change", { bubbles: true }));
  });
}
// Moments are in the zone of whoever reads, with the server's as their title; without this they stay in the server's.
function inOwnZone(part) {
  for (const shown of part.querySelectorAll("time[datetime]")) {
    const moment = new Date(shown.dateTime);
    const ahead = -moment.getTimezoneOffset();
    const two = (number) => String(number).padStart(2, "0");
    const day = `${moment.getFullYear()}-${two(moment.getMonth() + 1)}-${two(moment.getDate())}`;
    const [hours, minutes] = [Math.trunc(Math.abs(ahead) / 60), Math.abs(ahead) % 60];
    const zone = ahead ? `UTC${ahead < 0 ? "-" : "+"}${hours}${minutes ? `:${two(minutes)}` : ""}` : "UTC";
    const zoned = shown.querySelector(".zone");
    if (!zoned || zoned.textContent === zone) continue;
    shown.title = shown.textContent;
    zoned.textContent = zone;
    shown.firstChild.data = `${day} ${two(moment.getHours())}:${two(moment.getMinutes())} `;
  }
}
inOwnZone(document);
document.addEventListener("htmx:load", (event) => inOwnZone(event.target));
