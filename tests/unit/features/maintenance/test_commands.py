"""The command that shows everybody a notice."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.command_line import app
from app.config import Settings
from app.db.store import Store


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path / "home"))
    # What is logged of a database that is made stands before no answer.
    Store.open(Settings()).close()


def run(*words: str) -> Result:
    return CliRunner().invoke(app, ["maintenance", *words])


class TestMaintenance:
    def test_a_notice_is_set_told_and_taken_away(self) -> None:
        assert run("Upgrade at 18:00", "--until", "2099-01-31T18:00+01:00").exit_code == 0
        told = json.loads(run("--json").stdout)
        assert told == {
            "text": "Upgrade at 18:00",
            "starts": None,
            "until": "2099-01-31T17:00:00.000000+00:00",
        }
        assert json.loads(run("--clear", "--json").stdout) == {"text": None}

    @pytest.mark.parametrize(
        "words",
        [
            ("x", "--clear"),
            ("--until", "2099-01-31T18:00"),
            ("x", "--until", "tomorrow"),
        ],
    )
    def test_what_says_nothing_clear_is_refused(self, words: tuple[str, ...]) -> None:
        assert run(*words).exit_code == 2
        assert json.loads(run("--json").stdout) == {"text": None}
