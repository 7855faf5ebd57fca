// The texts of the replay in the reader's language. These files contain no texts: whoever shows the component defines words().

// Returns a sentence with its placeholders filled in: "%(seconds)s of %(all)s".
function say(name, parts = {}) {
  return words().sentences[name].replace(/%\((\w+)\)s/g, (_, part) => parts[part]);
}

// Returns the text of a key in one of the tables, or the key itself if it has no text.
function worded(table, name) {
  return Object.hasOwn(words()[table], name) ? words()[table][name] : name;
}

function whole(number) {
  return number.toLocaleString(document.documentElement.lang || undefined);
}
