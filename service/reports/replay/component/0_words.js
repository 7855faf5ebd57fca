// What the replay says, in the language of the page, whose data has it: nothing in these files is a word by itself.

const WORDS = wordsOf(document.querySelector("section.replay > script"));

function wordsOf(island) {
  return island ? JSON.parse(island.textContent).words : null;
}

// A sentence with its parts: "%(seconds)s of %(all)s".
function say(name, parts = {}) {
  return WORDS.sentences[name].replace(/%\((\w+)\)s/g, (_, part) => parts[part]);
}

// The word for something in one of the tables; what has none there is called as it is.
function worded(table, name) {
  return Object.hasOwn(WORDS[table], name) ? WORDS[table][name] : name;
}

function whole(number) {
  return number.toLocaleString(document.documentElement.lang);
}
