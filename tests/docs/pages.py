"""Pages: texts that the documents and the help inside the product have in common.

``static/help/glossary.json`` is the glossary; ``docs/glossary.md`` is written from it.
``docs/queries.md`` is written from the fields of the queue.
``docs/review-guide.md`` is the guide; ``static/help/guide.json`` is written from it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from app.features.queue.fields import FIELDS, ORDERS
from app.soccer.pitch import MARKINGS

ROOT = Path(__file__).resolve().parents[2]
GLOSSARY = ROOT / "static" / "help" / "glossary.json"
GLOSSARY_PAGE = ROOT / "docs" / "glossary.md"
GUIDE_PAGE = ROOT / "docs" / "review-guide.md"
GUIDE = ROOT / "static" / "help" / "guide.json"

QUERIES_PAGE = ROOT / "docs" / "queries.md"
QUERIES_TEXT = """
A query says which groups are meant: in the search box of the queue, as `q` of every request that has one, in saved views and in
`touchline verdict`. `GET /api/v1/query-fields` answers the tables below.

```
status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax,bad_point -match:"Alder Town" sort:value-desc
```

- Terms stand between spaces and must all hold. `field:a,b` means either, where a field has choices or text. `-` before a term is its
  opposite. A bare word is looked for in label and key. Quotes hold spaces: `match:"Alder Town"`.
- `:` and `=` mean the same. Numbers also compare with `<` `<=` `>` `>=`; nothing that has no number fulfils that (so `-jac<0.9` finds it), and `field:none` finds it.
  An operator that a field does not have is refused with those that it has (400, `pointer` `/q/<position>`), and so is a field that there is not.
- Text is compared as it is: there are no patterns. `any` and `none` ask whether there is one.
- `sort:name` orders the list, `sort:name-desc` turns that round; the last one counts. What has no value comes last in both. Equal groups stand
  as in the dataset.
- At most 30 terms and 1,000 characters; in bodies, lists of ids may have 100,000.
""".strip()
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


def queries_page() -> str:
    """What docs/queries.md has to say."""
    rows = [
        f"| `{field.name}` | {field.kind} | {_listed(field.operators)} | {field.unit} | {field.meaning} "
        f"| {_listed(field.values)} | {_listed(field.also)} |"
        for field in FIELDS
        if field.kind != "order"
    ]
    table = "\n".join(
        [
            "| field | kind | operators | unit | what it is | values | also |",
            "|---|---|---|---|---|---|---|",
            *rows,
        ]
    )
    sorts = "\n".join(
        [
            "| sort | order |",
            "|---|---|",
            *(f"| `{item.name}` | {item.meaning} |" for item in ORDERS),
        ]
    )
    parts = ("# Queries", QUERIES_TEXT, "## Fields", table, "## Orders", sorts)
    return "\n\n".join(parts) + "\n"


def _listed(words: Iterable[str]) -> str:
    return " ".join(f"`{word}`" for word in words)


def guide_text() -> str:
    """What static/help/guide.json has to hold."""
    text = GUIDE_PAGE.read_text(encoding="utf-8")
    return json.dumps({"text": text}, ensure_ascii=False, indent=1) + "\n"
