"""A shell that was taught the commands completes them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.service import ROOT

Shell = Callable[..., str]
ANSWER = """
COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
_touchline_completion touchline
echo "${{COMPREPLY[@]}}"
"""


@pytest.fixture
def bash(tmp_path: Path) -> Shell:
    """Runs lines in a bash whose home is empty at first, and which finds ``touchline``."""
    (script := tmp_path / "bin" / "touchline").parent.mkdir()
    script.write_text(f"#!{sys.executable}\nfrom app.cli import main\nmain()\n")
    script.chmod(0o755)
    (home := tmp_path / "home").mkdir()
    environment = {"HOME": str(home), "PATH": f"{script.parent}:{os.environ['PATH']}"}

    def run(lines: str, **more: str) -> str:
        done = subprocess.run(
            ["bash", "-e"],
            input=lines,
            cwd=home,
            env={**environment, "PYTHONPATH": str(ROOT), **more},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


class TestBash:
    def test_completes_commands_and_options_once_it_was_installed(self, bash: Shell) -> None:
        bash("touchline --install-completion\ntrue")
        asked = ("touchline exp", "touchline datasets d", "touchline freeze --gro")
        answers = bash(". ~/.bashrc" + "".join(ANSWER.format(words=words) for words in asked))
        assert answers.splitlines() == ["export", "delete", "--groups"]


class TestScripts:
    @pytest.mark.parametrize(
        ("shell", "sentence"),
        [
            ("bash", "complete -o default -F _touchline_completion touchline"),
            ("zsh", "compdef _touchline_completion touchline"),
            ("fish", "complete --command touchline"),
        ],
    )
    def test_of_every_shell_are_printed(self, bash: Shell, shell: str, sentence: str) -> None:
        # Else it is that of the shell which asks.
        named = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
        assert sentence in bash(f"touchline --show-completion {shell}", **named)
