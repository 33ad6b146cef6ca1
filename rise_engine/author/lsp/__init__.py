"""The language server of studies, `rise-engine lsp` (docs/how-to/editor.md)."""
