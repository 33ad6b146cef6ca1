-- Starts the language server of studies in Neovim before 0.11 (docs/how-to/editor.md).
vim.api.nvim_create_autocmd("FileType", {
  pattern = { "xml", "toml", "json" },
  callback = function()
    local here = vim.fn.expand("%:p:h")
    local found = vim.fn.findfile("scenario.toml", here .. ";")
    if found == "" then return end
    local root = vim.fn.fnamemodify(found, ":p:h")
    local id = vim.g.rise_client
    if not (id and vim.lsp.get_client_by_id(id)) then
      id = vim.lsp.start_client({ name = "rise", cmd = { "rise-engine", "lsp" }, root_dir = root })
      vim.g.rise_client = id
    end
    vim.lsp.buf_attach_client(0, id)
  end,
})
