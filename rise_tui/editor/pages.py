"""All pages of the editor, by their kind. A new page is one line here (`rise_tui.editor.page` says how)."""

from __future__ import annotations

from collections.abc import Callable

from rise_tui.editor.act_page import ActPage
from rise_tui.editor.data_pages import KeysPage, MemoryPage, SettingsPage
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.study_page import StudyPage
from rise_tui.editor.tables_page import TablesPage
from rise_tui.editor.texts_page import TextsPage

PAGES: dict[str, Callable[[EditFrame, str], EditPage]] = {
    page.KIND: page
    for page in (
        StudyPage,
        ActPage,
        RulePage,
        TextsPage,
        MemoryPage,
        KeysPage,
        SettingsPage,
        TablesPage,
    )
}
"""The first is what the editor opens with."""
