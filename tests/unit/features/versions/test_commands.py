"""The commands on versions: what is parsed, what is printed, which code comes back."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.store import Store
from tests.databases import said_for_sqlite

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home whose sample dataset is solved, and frozen twice."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture
def run(touchline: Run) -> Run:
    return touchline


@pytest.fixture
def frozen(run: Run, home: Path) -> Path:
    if not (home / "home.json").exists():
        options = ("--groups", 4, "--labels-only", "--no-faults", "--workers", 1)
        assert run("sample", "--dataset", "demo", *options)[0] == 0
        assert run("freeze", "--dataset", "demo", "--groups", "passing")[0] == 0
        split = ("--split", "match", "--seed", 3, "--test-share", 0.5)
        code, _, err = run("freeze", "--dataset", "demo", "two", "--groups", "passing", *split)
        assert code == 0, err
    return home


class TestFreeze:
    def test_without_a_name_it_takes_the_next_one(self, run: Run, frozen: Path) -> None:
        listed = json.loads(run("versions", "--dataset", "demo", "--json")[1])
        assert [item["name"] for item in listed] == ["two", "v1"]
        assert listed[0]["split"] == {"kind": "match", "seed": 3, "test_share": 0.5}

    def test_a_dry_run_counts_and_saves_nothing(self, run: Run, frozen: Path) -> None:
        code, out, _ = run("freeze", "--dataset", "demo", "--dry-run", "--json")
        assert (code, json.loads(out)["groups"]) == (0, 0)
        assert len(run("versions", "--dataset", "demo")[1].splitlines()) == 2

    @pytest.mark.parametrize(
        "words", [("a", "--name", "b"), ("--licence", "CC0", "--licence-file")]
    )
    def test_two_options_that_contradict_each_other_are_refused(
        self, run: Run, frozen: Path, tmp_path: Path, words: tuple[str, ...]
    ) -> None:
        (file := tmp_path / "licence.txt").write_text("CC BY 4.0")
        given = (*words, file) if words[-1] == "--licence-file" else words
        code, _, err = run("freeze", "--dataset", "demo", *given, "--dry-run")
        assert code == 2
        assert "once" in err

    def test_a_licence_file_that_is_no_text_is_one_sentence(
        self, run: Run, frozen: Path, tmp_path: Path
    ) -> None:
        picture = tmp_path / "licence.png"
        picture.write_bytes(b"\x89PNG\xff")
        code, out, err = run("freeze", "--dataset", "demo", "--licence-file", str(picture))
        assert (code, out, err.strip()) == (1, "", f"{picture} cannot be read as text")

    def test_a_pipe_in_the_place_of_a_licence_file_is_refused_at_once(
        self, run: Run, frozen: Path, tmp_path: Path
    ) -> None:
        os.mkfifo(tmp_path / "pipe")
        code, out, err = run(
            "freeze", "--dataset", "demo", "--licence-file", str(tmp_path / "pipe")
        )
        assert (code, out, err.strip()) == (1, "", f"{tmp_path}/pipe is not a regular file")

    def test_nothing_to_freeze_is_one_sentence(self, run: Run, frozen: Path) -> None:
        code, out, err = run("freeze", "--dataset", "demo")
        assert (code, out) == (1, "")
        assert "no group" in err and "passing" in err

    def test_a_name_that_is_taken_is_refused(self, run: Run, frozen: Path) -> None:
        code, _, err = run("freeze", "v1", "--dataset", "demo", "--groups", "passing")
        assert (code, 'has a version "v1" already' in err) == (1, True)


class TestDiff:
    def test_tells_what_changed(self, run: Run, frozen: Path) -> None:
        code, out, _ = run("diff", "v1", "two", "--dataset", "demo")
        assert code == 0
        assert out.startswith("Since v1:\n")
        assert json.loads(run("diff", "v1", "v1", "--dataset", "demo", "--json")[1])["same"]

    def test_an_unknown_version_is_named(self, run: Run, frozen: Path) -> None:
        code, _, err = run("diff", "v1", "v9", "--dataset", "demo")
        assert (code, 'no version "v9"' in err) == (1, True)


class TestVerify:
    def test_a_sound_version_verifies(self, run: Run, frozen: Path) -> None:
        options = ("--dataset", "demo", "--workers", 1, "--json")
        code, out, err = run("verify", *options)
        assert (code, json.loads(out)["ok"], json.loads(out)["version"]) == (0, True, "two"), err
        assert json.loads(run("verify", "v1", *options)[1])["version"] == "v1"

    def test_a_changed_one_is_exit_code_1_and_names_the_place(self, run: Run, frozen: Path) -> None:
        store = Store.open(Settings(home=frozen))
        change = "UPDATE version_group SET split = 'x' WHERE position = 0 AND version_id = 1"
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER version_group_refuses_update"))
            session.execute(text(change))
        store.close()
        code, out, err = run("verify", "v1", "--dataset", "demo", "--workers", 1)
        assert (code, "split: x frozen" in out) == (1, True)
        assert "differently" in err


class TestExport:
    def test_of_a_version_is_the_same_bytes_every_time(
        self, run: Run, frozen: Path, tmp_path: Path
    ) -> None:
        for name in ("a.zip", "b.zip"):
            options = ("--dataset", "demo", "--format", "soccernet-v3d", "--version", "two")
            code, _, err = run("export", tmp_path / name, *options)
            assert code == 0, err
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()

    def test_of_a_version_cannot_be_of_everything(
        self, run: Run, frozen: Path, tmp_path: Path
    ) -> None:
        options = ("--dataset", "demo", "--format", "cameras", "--version", "two", "--all")
        assert run("export", tmp_path / "x", *options)[0] == 1
