"""How the features are built: routes ask services, services ask queries, queries ask tables."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
BELOW = {
    "tables": {"tables"},
    "values": {"values"},
    "queries": {"tables", "values", "queries"},
    "service": {"values", "queries", "service"},
    "schemas": {"values", "queries", "service", "schemas"},
    "routes": {"values", "queries", "service", "schemas", "routes"},
    "commands": {"values", "queries", "service", "commands"},
}
"""What modules of each kind import, in their own feature and in others."""
VALUES = {
    "imports.upload_quota",
    "solutions.codec",
}
"""Values and rules that queries and services share: they ask no database."""
WITHOUT_HTTP = {"tables", "values", "queries", "service"}
COPIES_ALL_TABLES = "integrity.transfer"


def kind(module: str) -> str:
    """What a module of a feature is, by its name."""
    name = module.rsplit(".", 1)[1]
    for suffix in ("tables", "queries", "schemas", "routes", "commands"):
        if name == suffix or name.endswith(f"_{suffix}"):
            return suffix
    return "values" if module in VALUES else "service"


@cache
def imports() -> dict[str, set[str]]:
    """Modules of features, as ``feature.module``, with all modules of ``app`` that each imports."""
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path
        for path in (ROOT / "app").rglob("*.py")
    }
    found = {}
    for name, path in files.items():
        if not name.startswith("app.features.") or name.count(".") < 3 or path.stem == "__init__":
            continue
        found[name.removeprefix("app.features.")] = {
            whole if whole in files else node.module
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom) and node.module
            for whole in (f"{node.module}.{alias.name}" for alias in node.names)
            if node.module.startswith("app") or node.module.startswith("sqlalchemy")
        }
    return found


def of_features(asked: set[str]) -> list[str]:
    """Those modules that belong to features, as ``feature.module``."""
    short = [name.removeprefix("app.features.") for name in asked if "app.features." in name]
    return [name for name in short if name.count(".") == 1 and name in imports()]


def test_every_module_imports_only_kinds_below_its_own() -> None:
    wrong = [
        f"{module} imports {name}"
        for module, names in imports().items()
        for name in of_features(names)
        if kind(name) not in BELOW[kind(module)]
    ]
    assert wrong == []


def test_sql_stands_in_queries_and_tables() -> None:
    wrong = [
        f"{module} imports {name}"
        for module, names in imports().items()
        if kind(module) not in ("tables", "queries") and module != COPIES_ALL_TABLES
        for name in names
        if name.startswith("sqlalchemy")
    ]
    assert wrong == []


def test_only_routes_and_schemas_know_http() -> None:
    wrong = [
        f"{module} imports {name}"
        for module, names in imports().items()
        if kind(module) in WITHOUT_HTTP
        for name in names
        if name.startswith("app.http")
    ]
    assert wrong == []


def test_services_of_features_ask_each_other_in_one_direction() -> None:
    asked: dict[str, set[str]] = defaultdict(set)
    for module, names in imports().items():
        for name in of_features(names):
            one, other = module.split(".")[0], name.split(".")[0]
            if one != other and kind(module) == kind(name) == "service":
                asked[one].add(other)
    left = set(asked)
    while left:
        free = {feature for feature in left if not asked[feature] & left}
        assert free, f"these ask each other in a circle: {sorted(left)}"
        left -= free
