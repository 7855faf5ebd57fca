// Builds ../static/editor.min.js. Its first line has the hash of the sources, which a test compares.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const SOURCES = ["build.mjs", "editor.js", "package-lock.json", "page.js"];

// Returns the licence text of each package in the built file.
function licences(inputs) {
  const packages = new Set(inputs.map((path) => path.match(/node_modules\/((?:@[^/]+\/)?[^/]+)\//)?.[1]).filter(Boolean));
  const namesByText = new Map();
  for (const name of [...packages].sort()) {
    const folder = `node_modules/${name}`;
    const file = readdirSync(folder).find((each) => /^licen[cs]e/i.test(each));
    const text = readFileSync(`${folder}/${file}`, "utf8").trim();
    namesByText.set(text, [...(namesByText.get(text) ?? []), name]);
  }
  return [...namesByText].map(([text, names]) => `${names.join(", ")}\n\n${text}`).join("\n\n");
}

const hash = createHash("sha256");
for (const source of SOURCES) hash.update(readFileSync(source));

const built = await build({
  entryPoints: ["page.js"],
  bundle: true,
  minify: true,
  format: "iife",
  target: ["chrome99", "firefox101", "safari16.4"],
  legalComments: "none",
  metafile: true,
  write: false,
});
const notice = licences(Object.keys(built.metafile.inputs)).replaceAll("*/", "* /");
writeFileSync("../static/editor.min.js", `/* sources: ${hash.digest("hex")}\n\n${notice}\n*/\n${built.outputFiles[0].text}`);
