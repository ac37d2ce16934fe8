"""Compile what numba compiles, once: processes side by side would each do it, for seconds."""

from __future__ import annotations

from multiprocessing import Process

import numpy as np

from app.paint.view_paint import paint_of
from app.paint.view_proposal import proposal_of
from app.sample.render import render
from app.sample.scene import Scene
from app.soccer.policy import PAPER
from app.solving.solve import solve
from app.solving.warm import warm_up
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
    image = np.ascontiguousarray(render(scene, view.key)[:, :, ::-1])
    assert proposal_of(image, view.size, (), pitch, policy).lines
    solving.join()
    assert solving.exitcode == 0
    first = solve(scene.group, PAPER).views[0].calibration
    assert paint_of(image, view.size, first, pitch, policy).outcome == "snapped"


def _solve(scene: Scene) -> None:
    warm_up()
    assert solve(scene.group, PAPER).views[0].calibration
    ball = made_ball(2.0)
    times = frame_times(ball)
    assert not track_ball(
        main(ball, 0), np.arange(len(times)), times, pitch=scene.group.pitch
    ).reason


if __name__ == "__main__":
    compile_all()
