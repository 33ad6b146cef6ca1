// Starts `rise-engine lsp` for the files of RISE studies.
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

function activate() {
  const command = workspace.getConfiguration("rise").get("command");
  const files = [
    "**/{acts,rules,patterns}/*.xml",
    "**/scenario.toml",
    "**/lexicon.toml",
    "**/memory.json",
    "**/{robots,texts,tables}/*.toml",
  ];
  client = new LanguageClient(
    "rise",
    "RISE studies",
    { command, args: ["lsp"] },
    {
      documentSelector: files.map((pattern) => ({ scheme: "file", pattern })),
      synchronize: { fileEvents: files.map((pattern) => workspace.createFileSystemWatcher(pattern)) },
    },
  );
  return client.start();
}

function deactivate() {
  return client ? client.stop() : undefined;
}

module.exports = { activate, deactivate };
