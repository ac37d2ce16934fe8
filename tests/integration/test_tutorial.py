"""The tutorials, command by command, as somebody types them into a shell."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.service import free_port

ROOT = Path(__file__).resolve().parents[2]
PAGES = {name: ROOT / "docs" / f"{name}.md" for name in ("tutorial", "tutorial-recording")}
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
COMMAND = "from app.cli import main; main()"


def blocks(kind: str, page: str = "tutorial") -> list[str]:
    """The blocks of a page in one language."""
    text = PAGES[page].read_text(encoding="utf-8")
    return [block for name, block in BLOCK.findall(text) if name == kind]


def new_shell(folder: Path) -> tuple[Path, dict[str, str]]:
    """A folder with ``docs`` in it, and an environment with ``touchline`` and ``python``."""
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


def run_in(shell: tuple[Path, dict[str, str]], commands: str) -> str:
    """What commands print, one after the other."""
    folder, environment = shell
    done = subprocess.run(
        ["bash", "-e", "-u"],
        input=commands,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def shell(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    return new_shell(tmp_path_factory.mktemp("tutorial"))


@pytest.fixture(scope="module")
def told(shell: tuple[Path, dict[str, str]]) -> str:
    """What all commands print, one after the other."""
    return run_in(shell, "\n".join(blocks("sh")))


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


SHORT = "36"
"""Seconds of the recording, of which the page has three minutes."""


class TestTutorialOfARecording:
    def test_a_broadcast_becomes_a_version_with_balls(self, tmp_path: Path) -> None:
        port = str(free_port())
        shell = new_shell(tmp_path)
        (tmp_path / "tutorial").mkdir()
        steps = "".join(blocks("python", "tutorial-recording")).replace("8000", port)
        (tmp_path / "tutorial" / "steps.py").write_text(steps)
        commands = "\n".join(blocks("sh", "tutorial-recording")).replace("8000", port)
        drawn = "touchline sample-recording tutorial/film.mp4"
        assert drawn in commands
        commands = commands.replace(drawn, f"{drawn} --seconds {SHORT}")
        # The server ends with the shell, also where a command fails.
        told = run_in(shell, "trap 'kill \"${SERVER:-}\" 2> /dev/null || true' EXIT\n" + commands)
        for sentence in (
            r"frames +900\n",
            r"900 frames, 11 shots, 2 replays",
            r"main \d+ frames of film: (\d+) tracked, 0 bridged, 0 lost",
            r"replay \d+ frames of film: (\d+) tracked, 0 bridged, 0 lost",
            r"turned by half: True",
            r"speed 0\.\d\d, known to 0\.0\d",
            r"(\d+) groups, \1 views of the replay",
            r"balls, 0 refused",
            r"missing images +0",
        ):
            assert re.search(sentence, told), (sentence, told)
        accepted = re.search(r"counts +groups (\d+), views (\d+), boxes (\d+), balls (\d+)", told)
        assert accepted is not None, told
        groups, views, boxes, balls = map(int, accepted.groups())
        assert groups >= 6
        assert views == boxes == 2 * groups
        assert balls > 0
        assert (tmp_path / "tutorial" / "overlay.png").stat().st_size > 10_000
