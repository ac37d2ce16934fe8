"""JoinedModules: joined modules are sent while they are of the modules beside them."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest

from app.http.pages import FOLDER, STATIC, BrowserSite, JoinedModules, digest_modules

PAGE = b"""<html><head>
\t<script type="module" async src="/static/ahead.js"></script>
\t<link rel="modulepreload" href="/static/lib/a.js">
\t<script type="module" src="/static/main.js"></script>
\t<link rel="modulepreload" href="/static/lib/b.js" fetchpriority="low">
</head><body></body></html>
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An application of three modules, joined."""
    (tmp_path / "lib").mkdir()
    for name in ("main.js", "lib/a.js", "lib/b.js"):
        (tmp_path / name).write_text(f"// {name}\n")
    (tmp_path / "package-lock.json").write_text("{}")
    (tmp_path / "index.html").write_bytes(PAGE)
    join(tmp_path)
    return tmp_path


def join(folder: Path) -> None:
    """What ``npm run build`` leaves."""
    (folder / FOLDER).mkdir(exist_ok=True)
    for name in ("ahead.js", "main.js", "chunk-1.js"):
        (folder / FOLDER / name).write_text(f"/* {name} */")
    about = {"of": digest_modules(folder), "needed_first": ["chunk-1.js"]}
    (folder / FOLDER / "about.json").write_text(json.dumps(about))


def asked_for(folder: Path) -> list[str]:
    """The modules that the page of a folder asks for."""
    page = BrowserSite(folder).get_index_page()
    assert page is not None
    return re.findall(r'(?:src|href)="/assets/\w+/([^"]+)"', page.html.decode())


class TestJoinedModules:
    def test_the_page_asks_for_the_joined_files_and_for_nothing_else(self, folder) -> None:
        assert asked_for(folder) == ["built/ahead.js", "built/main.js", "built/chunk-1.js"]
        page = BrowserSite(folder).get_index_page()
        assert page is not None
        assert page.modules == ("built/ahead.js", "built/main.js", "built/chunk-1.js")

    @pytest.mark.parametrize(
        "change",
        [
            lambda at: (at / "lib" / "b.js").write_text("// another\n"),
            lambda at: (at / "lib" / "c.js").write_text("// new\n"),
            lambda at: (at / "lib" / "b.js").unlink(),
            lambda at: (at / "lib" / "b.js").rename(at / "lib" / "c.js"),
            lambda at: (at / "package-lock.json").write_text('{"another": "library"}'),
        ],
        ids=["changed", "added", "gone", "renamed", "library"],
    )
    def test_who_changes_a_module_gets_the_modules_until_they_are_joined_again(
        self, folder, change
    ) -> None:
        site = BrowserSite(folder)
        change(folder)
        assert site.get_index_page().modules == ("ahead.js", "lib/a.js", "main.js", "lib/b.js")
        join(folder)
        assert site.get_index_page().modules[0] == "built/ahead.js"

    @pytest.mark.parametrize(
        "about", ["", "[]", "{}", '{"of": 3}', '{"of": "OF"}', '{"of": "OF", "needed_first": 3}']
    )
    def test_what_does_not_say_what_it_is_of_is_not_used(self, folder, about) -> None:
        text = about.replace("OF", digest_modules(folder))
        (folder / FOLDER / "about.json").write_text(text)
        assert JoinedModules.read(folder) is None
        assert "main.js" in asked_for(folder)

    def test_files_of_libraries_and_of_earlier_builds_are_no_modules(self, folder) -> None:
        before = digest_modules(folder)
        for name in ("node_modules/preact", FOLDER, f"{FOLDER}.new"):
            (folder / name).mkdir(parents=True, exist_ok=True)
            (folder / name / "x.js").write_text("// x\n")
        assert digest_modules(folder) == before

    def test_its_digest_is_of_names_and_contents_and_of_nothing_else(self, folder) -> None:
        before = digest_modules(folder)
        os.utime(folder / "main.js", (1, 1))
        assert digest_modules(folder) == before


class TestBuilt:
    def test_the_application_was_joined_and_both_sides_agree_on_what_it_is_of(self) -> None:
        joined = JoinedModules.read(STATIC)
        assert joined is not None, "run 'make setup': a module has changed since they were joined"
        names = {path.name for path in (STATIC / FOLDER).glob("*.js")}
        assert {"ahead.js", "main.js", *joined.needed_first} <= names
        assert len(joined.needed_first) < 12, "a page would ask for many files again"
