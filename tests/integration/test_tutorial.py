"""The tutorial, command by command, as somebody types it into a shell."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorial.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
COMMAND = "from app.cli import main; main()"


def blocks(kind: str) -> list[str]:
    """The blocks of the page in one language."""
    return [text for name, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")) if name == kind]


@pytest.fixture(scope="module")
def shell(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A folder with ``docs`` in it, and an environment with ``touchline`` and ``python``."""
    folder = tmp_path_factory.mktemp("tutorial")
    (folder / "docs").symlink_to(ROOT / "docs")
    (folder / "bin").mkdir()
    python = shlex.quote(sys.executable)
    for name, call in (
        ("python", f'exec {python} "$@"'),
        ("touchline", f'exec {python} -c {shlex.quote(COMMAND)} "$@"'),
    ):
        (script := folder / "bin" / name).write_text(f"#!/bin/sh\n{call}\n")
        script.chmod(0o755)
    kept = {name: text for name, text in os.environ.items() if not name.startswith("TOUCHLINE_")}
    more = {
        "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "agg",
        # One group is no work for several processes, each of which would load the solver.
        "TOUCHLINE_WORKERS": "1",
    }
    return folder, {**kept, **more}


@pytest.fixture(scope="module")
def told(shell: tuple[Path, dict[str, str]]) -> str:
    """What all commands print, one after the other."""
    folder, environment = shell
    done = subprocess.run(
        ["bash", "-e", "-u"],
        input="\n".join(blocks("sh")),
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


class TestTutorial:
    def test_two_frames_become_a_version_with_one_ball(self, told: str) -> None:
        for sentence in (
            r"imported +1\nnew +1",
            r"proposed +2\nunsure +0",
            r"1 pass, 0 do not; 0 errors",
            r"counts +groups 1, views 2, boxes 2, balls 2",
            r"missing images +0",
        ):
            assert re.search(sentence, told), (sentence, told)

    def test_the_ball_is_drawn_and_a_model_trains(self, told: str, shell) -> None:
        assert "2 samples to train on" in told
        first, *_, last = (float(text) for text in re.findall(r"loss ([\d.]+)", told))
        assert last < first
        assert (shell[0] / "tutorial" / "overlay.png").stat().st_size > 10_000

    def test_the_loop_for_pytorch_runs_where_that_is_installed(self, told: str, shell) -> None:
        pytest.importorskip("torch")
        folder, environment = shell
        (script := folder / "loop.py").write_text("\n".join(blocks("python")))
        subprocess.run([sys.executable, script], cwd=folder, env=environment, check=True)
