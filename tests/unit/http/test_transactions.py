"""Routes pass the database on; whoever asks it stands on the floor below."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

APP = Path(__file__).parents[3] / "app"
SOURCES = sorted([*(APP / "http").glob("*.py"), *(APP / "features").rglob("*routes.py")])


def transactions(source: str) -> list[int]:
    """Lines that open one."""
    opened = [
        item.context_expr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, (ast.With, ast.AsyncWith))
        for item in node.items
    ]
    return [
        call.lineno
        for call in opened
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr in ("read", "glance", "peek", "write")
    ]


def test_no_route_opens_a_transaction() -> None:
    found = {path.name: lines for path in SOURCES if (lines := transactions(path.read_text()))}
    assert (len(SOURCES) > 40, found) == (True, {})


@pytest.mark.parametrize("way", ["read", "glance", "peek", "write"])
def test_the_search_finds_a_transaction_that_is_opened(way: str) -> None:
    assert transactions(f"with store.{way}() as session:\n    ...") == [1]
