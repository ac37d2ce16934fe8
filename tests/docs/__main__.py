"""Write the pages that follow from others: ``python -m tests.docs``."""

from __future__ import annotations

from tests.docs.fixes import PAGE, fixes_page
from tests.docs.group import GROUP_FILE, group_page
from tests.docs.pages import (
    GLOSSARY_PAGE,
    GUIDE,
    QUERIES_PAGE,
    glossary_page,
    guide_text,
    queries_page,
)
from tests.docs.settings import SETTINGS_PAGE, settings_page

if __name__ == "__main__":
    GLOSSARY_PAGE.write_text(glossary_page(), encoding="utf-8")
    PAGE.write_text(fixes_page(), encoding="utf-8")
    QUERIES_PAGE.write_text(queries_page(), encoding="utf-8")
    GUIDE.write_text(guide_text(), encoding="utf-8")
    SETTINGS_PAGE.write_text(settings_page(), encoding="utf-8")
    GROUP_FILE.write_text(group_page(), encoding="utf-8")
