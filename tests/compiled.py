"""Compile what numba and pytest compile, once: processes side by side would each do it, for seconds."""

from __future__ import annotations

import subprocess
import sys
from multiprocessing import Process
from pathlib import Path

import numpy as np

from app.paint.view_paint import read_paint_of_image
from app.paint.view_proposal import propose_lines_in_image
from app.sample.render import render_view
from app.sample.scene import Scene
from app.soccer.policy import PAPER
from app.solving.solve import solve_group, warm_up_solver
from app.tracking.ball_solve import track_ball
from tests.bench.ball_track import frame_times, main
from tests.bench.link import made_ball
from tests.scenes import make_scenes


def compile_all() -> None:
    """Solve a group, draw one of its pictures and read it, track a ball; what was compiled is loaded.

    Another process solves meanwhile: it is not the half of it, and reading comes to it last.
    """
    scene = make_scenes(groups=1, seed=3, faults=False)[0]
    solving = Process(target=_solve, args=(scene,))
    solving.start()
    view, pitch, policy = scene.group.views[0], scene.group.pitch, PAPER.calibration
    image = np.ascontiguousarray(render_view(scene, view.key)[:, :, ::-1])
    assert propose_lines_in_image(image, view.size, (), pitch, policy).lines
    solving.join()
    assert solving.exitcode == 0
    first = solve_group(scene.group, PAPER).views[0].calibration
    assert read_paint_of_image(image, view.size, first, pitch, policy).outcome == "snapped"


def compile_tests() -> None:
    """Let one process collect the tests where none has: it keeps its modules as pytest rewrites them."""
    tests = Path(__file__).parent
    if any((tests / "unit" / "__pycache__").glob("*-pytest-*.pyc")):
        return
    command = [sys.executable, "-m", "pytest", "--collect-only", "--quiet", "-n0", str(tests)]
    # What cannot be collected is told by the tests themselves.
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)


def _solve(scene: Scene) -> None:
    warm_up_solver()
    assert solve_group(scene.group, PAPER).views[0].calibration
    ball = made_ball(2.0)
    times = frame_times(ball)
    assert not track_ball(
        main(ball, 0), np.arange(len(times)), times, pitch=scene.group.pitch
    ).reason


if __name__ == "__main__":
    tests = Process(target=compile_tests)
    tests.start()
    compile_all()
    tests.join()
