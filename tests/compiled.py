"""Compile what numba compiles, once: processes side by side would each do it, for seconds."""

from __future__ import annotations

from app.sample.render import render
from app.soccer.policy import PAPER
from app.solving.solve import solve
from app.solving.warm import warm_up
from tests.scenes import make_scenes


def compile_all() -> None:
    """Solve a group and draw one of its pictures; what was compiled before is loaded."""
    warm_up()
    scene = make_scenes(groups=1, seed=3, faults=False)[0]
    solve(scene.group, PAPER)
    render(scene, scene.group.views[0].key)


if __name__ == "__main__":
    compile_all()
