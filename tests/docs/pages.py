"""Pages: texts that the documents and the help inside the product have in common.

``static/help/glossary.json`` is the glossary; ``docs/glossary.md`` is written from it.
``docs/review-guide.md`` is the guide; ``static/help/guide.json`` is written from it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from app.soccer.pitch import MARKINGS

ROOT = Path(__file__).resolve().parents[2]
GLOSSARY = ROOT / "static" / "help" / "glossary.json"
GLOSSARY_PAGE = ROOT / "docs" / "glossary.md"
GUIDE_PAGE = ROOT / "docs" / "review-guide.md"
GUIDE = ROOT / "static" / "help" / "guide.json"

MARKINGS_TEXT = """
Left and right, top and bottom are those of the main cameras' picture of the pitch. Posts are named as
seen from the pitch. Big rect. is the penalty area, small rect. the goal area; "main" is the side parallel
to the goal line. `Line unknown` and `Goal unknown` exist in files and have no geometry.
""".strip()


def sections() -> list[dict[str, Any]]:
    """The glossary's sections, each with its words."""
    found: list[dict[str, Any]] = json.loads(GLOSSARY.read_text(encoding="utf-8"))["sections"]
    return found


def glossary_page() -> str:
    """What docs/glossary.md has to say."""
    parts = ["# Glossary", "The same words stand in the product under `?`, *Glossary*."]
    for section in sections():
        intro = [section["intro"]] if "intro" in section else []
        rows = [f"| {word['word']} | {word['meaning']} |" for word in section["words"]]
        table = "\n".join(["| word | meaning |", "|---|---|", *rows])
        parts += [f"## {section['title']}", *intro, table]
    names = ", ".join(f"`{name}`" for name in MARKINGS)
    parts += ["## The 26 markings", names + ".", MARKINGS_TEXT]
    return "\n\n".join(parts) + "\n"


def guide_text() -> str:
    """What static/help/guide.json has to hold."""
    text = GUIDE_PAGE.read_text(encoding="utf-8")
    return json.dumps({"text": text}, ensure_ascii=False, indent=1) + "\n"
