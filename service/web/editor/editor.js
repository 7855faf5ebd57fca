// An editor for Python in place of a textarea, which keeps the text for the form.
//
// It is in a shadow root, because CodeMirror then uses constructed style sheets, which the pages' policy allows.

import { closeBrackets, closeBracketsKeymap } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap, indentWithTab } from "@codemirror/commands";
import { pythonLanguage } from "@codemirror/lang-python";
import { HighlightStyle, bracketMatching, indentOnInput, indentUnit, syntaxHighlighting } from "@codemirror/language";
import { EditorState, Prec, RangeSet, StateEffect, StateField } from "@codemirror/state";
import {
  Decoration, EditorView, GutterMarker, WidgetType, gutterLineClass, highlightActiveLine, keymap, lineNumbers,
} from "@codemirror/view";
import { tags } from "@lezer/highlight";

// Milliseconds after Escape in which Tab leaves the editor. Any other key ends them.
const LEAVE_FOR = 60_000;

// The colours are those of the page, in light and dark.
const THEME = EditorView.theme({
  "&": { color: "var(--ink)", backgroundColor: "var(--paper)", minHeight: "inherit", maxHeight: "inherit" },
  "&.cm-focused": { outline: "none" },
  ".cm-scroller": { fontFamily: "inherit", lineHeight: "1.5", minHeight: "inherit" },
  ".cm-content": { caretColor: "var(--ink)", padding: "0.5rem 0" },
  ".cm-line": { padding: "0 0.6rem 0 0.4rem" },
  ".cm-gutters": { color: "var(--soft)", backgroundColor: "var(--wash)", border: "none" },
  ".cm-activeLine": { backgroundColor: "transparent" },
  "&.cm-focused .cm-activeLine": { backgroundColor: "var(--wash)" },
  "&.cm-focused .cm-matchingBracket": { backgroundColor: "var(--now)" },
  ".cm-line.cm-wrong": { backgroundColor: "var(--marked) !important" },
  ".cm-wrongNumber": { color: "var(--bad)", fontWeight: "700" },
  ".cm-message": { padding: "0.1rem 0.6rem 0.3rem 0.4rem", color: "var(--bad)", backgroundColor: "var(--marked)",
    fontFamily: "system-ui, sans-serif", whiteSpace: "pre-wrap" },
  ".cm-message::before": { content: "'▲ '" },
});

const COLOURS = HighlightStyle.define([
  { tag: [tags.keyword, tags.operatorKeyword, tags.controlKeyword, tags.definitionKeyword, tags.moduleKeyword],
    color: "var(--blue)", fontWeight: "600" },
  { tag: [tags.string, tags.special(tags.string)], color: "var(--good)" },
  { tag: [tags.number, tags.bool, tags.null], color: "var(--notice)" },
  { tag: tags.comment, color: "var(--soft)", fontStyle: "italic" },
  { tag: [tags.function(tags.definition(tags.variableName)), tags.definition(tags.className)], fontWeight: "600" },
  { tag: tags.invalid, color: "var(--bad)" },
]);

class Message extends WidgetType {
  constructor(text) {
    super();
    this.text = text;
  }

  eq(other) {
    return other.text === this.text;
  }

  toDOM() {
    const shown = document.createElement("div");
    shown.className = "cm-message";
    shown.textContent = this.text;
    return shown;
  }
}

const WRONG_NUMBER = new (class extends GutterMarker {
  elementClass = "cm-wrongNumber";
})();

const setErrors = StateEffect.define();

// The errors of the last run, each at its line and with its message below. They move with the text.
const ERRORS = StateField.define({
  create: () => Decoration.none,
  update(shown, transaction) {
    for (const effect of transaction.effects) {
      if (effect.is(setErrors)) return decorate(transaction.state.doc, effect.value);
    }
    return shown.map(transaction.changes);
  },
  provide: (field) => [
    EditorView.decorations.from(field),
    gutterLineClass.compute([field], (state) => numbersOf(state.field(field), state.doc)),
  ],
});

function decorate(doc, errors) {
  const marks = errors.filter(({ line }) => line >= 1 && line <= doc.lines).flatMap(({ line, message }) => {
    const { from, to } = doc.line(line);
    return [Decoration.line({ class: "cm-wrong" }).range(from),
      Decoration.widget({ widget: new Message(message), block: true, side: 1 }).range(to)];
  });
  return Decoration.set(marks, true);
}

function numbersOf(marks, doc) {
  const numbers = [];
  for (const cursor = marks.iter(); cursor.value; cursor.next()) numbers.push(doc.lineAt(cursor.from).from);
  return RangeSet.of([...new Set(numbers)].map((from) => WRONG_NUMBER.range(from)), true);
}

export class Editor {
  // Replaces a textarea. `run` is called for Ctrl+Enter. Texts are in the textarea's data attributes.
  constructor(field, run) {
    const label = field.labels[0];
    this.field = field;
    this.file = field.dataset.file;
    const host = document.createElement("div");
    host.className = "editor code";
    field.before(host);
    const root = host.attachShadow({ mode: "open" });
    const hint = document.createElement("p");
    hint.id = "hint";
    hint.hidden = true;
    hint.textContent = field.dataset.hint;
    root.append(hint);
    this.view = new EditorView({ parent: root, root, state: this.createState(label.textContent, run) });
    field.hidden = true;
    // Only the editor has the label's name now.
    label.removeAttribute("for");
    label.addEventListener("click", () => this.view.focus());
  }

  createState(name, run) {
    const leave = (view) => {
      view.setTabFocusMode(LEAVE_FOR);
      return true;
    };
    return EditorState.create({
      doc: this.field.value,
      extensions: [
        Prec.high(keymap.of([{ key: "Escape", run: leave }, { key: "Mod-Enter", run: () => run() ?? true }])),
        lineNumbers(), history(), indentOnInput(), bracketMatching(), closeBrackets(), highlightActiveLine(),
        pythonLanguage, indentUnit.of("    "), syntaxHighlighting(COLOURS), EditorView.lineWrapping, ERRORS, THEME,
        keymap.of([...closeBracketsKeymap, ...defaultKeymap, ...historyKeymap, indentWithTab]),
        EditorView.contentAttributes.of({ "aria-label": name, "aria-describedby": "hint" }),
        EditorView.updateListener.of((update) => {
          if (update.docChanged) this.field.value = this.text;
        }),
      ],
    });
  }

  get text() {
    return this.view.state.doc.toString();
  }

  // Replaces the text. Undo restores the previous one.
  replace(text) {
    this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text }, effects: setErrors.of([]) });
  }

  // Marks these errors instead of the previous ones: line numbers from 1, and messages.
  markErrors(errors) {
    this.view.dispatch({ effects: setErrors.of(errors) });
  }

  goToLine(number) {
    const { doc } = this.view.state;
    const { from } = doc.line(Math.max(1, Math.min(number, doc.lines)));
    this.view.dispatch({ selection: { anchor: from }, effects: EditorView.scrollIntoView(from, { y: "center" }) });
    this.view.focus();
  }
}
