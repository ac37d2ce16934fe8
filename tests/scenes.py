"""Scenes of the sample, all of them at once."""

from __future__ import annotations

from app.sample.fixture import group_counts_by_match
from app.sample.scene import Scene
from app.sample.scenes import make_match_scenes


def make_scenes(groups: int, seed: int, faults: bool = True) -> list[Scene]:
    """The scenes that ``write_sample`` draws for the same numbers."""
    return [
        scene
        for match, count in enumerate(group_counts_by_match(groups))
        for scene in make_match_scenes(match, count, seed, faults)
    ]
