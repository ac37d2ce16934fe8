"""Docstrings show and name what is there."""

import ast
import doctest
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAME = re.compile(r"``([a-z_]\w*(?:\.[a-z_]\w*)*)(?:\(\))?``")
MEMBER = re.compile(r"``([A-Z]\w*)\.([a-z_]\w*)(?:\(\))?``")
SCRIPTS = ("api", "state", "views", "overlays", "lib", "geometry", "tools")
OF_OTHERS = {"camera_00012.json", "instances_Train.json"}
"""Names in docstrings that are not of the code: files of an example."""


def test_the_examples_of_docstrings_come_out_as_they_say() -> None:
    finder, runner = doctest.DocTestFinder(exclude_empty=True), doctest.DocTestRunner(verbose=False)
    failed: list[str] = []
    for path, text in _sources().items():
        if ">>> " in text:
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            for example in finder.find(importlib.import_module(name), name):
                runner.run(example, out=failed.append)
    assert not failed, "".join(failed)
    assert runner.tries > 50


def test_names_in_docstrings_are_names_of_the_code() -> None:
    sources = _sources()
    known = {part for path in sources for part in re.split(r"[/.]", str(path))}
    for path in sources:
        known |= set(_names(_tree(path)))
    scripts = [path for part in SCRIPTS for path in (ROOT / "static" / part).rglob("*.js")]
    for path in [*scripts, ROOT / "pyproject.toml"]:
        known |= set(re.findall(r"\w+", path.read_text("utf-8")))
    said = {name for text in sources.values() for name in NAME.findall(text)}
    sought = {part for name in said for part in name.split(".")} - known
    for path in [*_files("tests"), *_files("migrations")]:
        # To parse all of them takes longer than all else.
        text = path.read_text("utf-8")
        if any(part in text for part in sought):
            known |= set(_names(ast.parse(text)))
    gone = [
        f"{path.relative_to(ROOT)}: {name}"
        for path, text in sources.items()
        for name in NAME.findall(text)
        if name not in OF_OTHERS and not known.issuperset(name.split("."))
    ]
    assert not gone, gone


def test_members_in_docstrings_are_members_of_their_class() -> None:
    members: dict[str, set[str]] = {}
    bases: dict[str, set[str]] = {}
    for path in _files("app"):
        for node in ast.walk(_tree(path)):
            if isinstance(node, ast.ClassDef):
                members.setdefault(node.name, set()).update(_names(node))
                above = {name for base in node.bases for name in _names(base)}
                bases.setdefault(node.name, set()).update(above)

    def has(owner: str, name: str) -> bool:
        if owner not in members or name in members[owner]:
            return True
        return any(has(base, name) for base in bases[owner] - {owner})

    gone = [
        f"{path.relative_to(ROOT)}: {owner}.{name}"
        for path, text in _sources().items()
        for owner, name in MEMBER.findall(text)
        if owner in members and not has(owner, name)
    ]
    assert not gone, gone


@cache
def _sources() -> dict[Path, str]:
    """What every module of the product says."""
    return {path: path.read_text("utf-8") for part in ("app", "touchline") for path in _files(part)}


@cache
def _tree(path: Path) -> ast.AST:
    return ast.parse(_sources()[path])


def _files(part: str) -> Iterator[Path]:
    return (ROOT / part).rglob("*.py")


def _names(tree: ast.AST) -> Iterator[str]:
    """Every name of a module's code, and the words of its short texts."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                yield name
            case ast.ClassDef(name=name):
                yield name
            case ast.keyword(arg=str(name)):
                yield name
            case ast.alias(name=name):
                yield from name.split(".")
            case ast.Constant(value=str(text)) if len(text) < 60:
                yield from re.findall(r"\w+", text)
