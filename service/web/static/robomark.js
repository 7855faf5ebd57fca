"use strict";
// Copy buttons. Without JavaScript, users select the field's text themselves.
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
// Back buttons. They keep the typed text. Without JavaScript, the browser's own back button does the same.
for (const back of document.querySelectorAll("[data-back]")) {
  back.hidden = history.length < 2;
  back.addEventListener("click", () => history.back());
}
// Drop zones: dropped files are set as the files of the zone's file field. Without JavaScript, the field itself works.
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
// Show times in the reader's time zone, with the server's time as tooltip. Without JavaScript, the server's time stays.
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
