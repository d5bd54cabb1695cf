// Hover text and completion of the keys of a deck, from keys.json beside this file.
const fs = require("fs");
const path = require("path");
const keys = JSON.parse(fs.readFileSync(path.join(__dirname, "keys.json"), "utf8"));

function groupAt(document, line) {
  for (let k = line; k >= 0; k--) {
    const found = /^\s*&(\w+)/.exec(document.lineAt(k).text);
    if (found) return found[1].toLowerCase();
  }
  return "";
}

function textOf(document, position) {
  const range = document.getWordRangeAtPosition(position, /\w+/);
  if (!range) return "";
  const word = document.getText(range).toLowerCase();
  return keys[`${groupAt(document, position.line)}.${word}`] || keys[word] || "";
}

function activate(context) {
  const vscode = require("vscode");
  context.subscriptions.push(
    vscode.languages.registerHoverProvider("talus-deck", {
      provideHover(document, position) {
        const text = textOf(document, position);
        return text ? new vscode.Hover(text.split("\n").join("\n\n")) : null;
      },
    }),
    vscode.languages.registerCompletionItemProvider("talus-deck", {
      provideCompletionItems(document, position) {
        const start = groupAt(document, position.line) + ".";
        return Object.keys(keys).filter((name) => name.startsWith(start)).map((name) => {
          const item = new vscode.CompletionItem(name.slice(start.length));
          item.documentation = keys[name];
          return item;
        });
      },
    }),
  );
}

module.exports = { activate, textOf };
