"""Every practice lesson shows its problem, and its answer mends it, under the shipped policy."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.features.practice.lessons import (
    CLEAN,
    LESSONS,
    make_practice_match,
    make_practice_scenes,
    write_practice,
)
from app.formats.soccernet_v3 import ARCHIVE
from app.sample.scene import PRACTICE_KINDS, Scene, read_truth
from app.sample.scenes import make_scene
from app.soccer.policy import PAPER
from app.soccer.solution import Solution
from app.solving.solve import solve_group

FAILS = {
    CLEAN: None,
    "wrong_label": "jac",
    "swapped_sides": "reprojection",
    "bad_point": "jac",
    "missing_ball": "ball",
    "not_synchronous": "reprojection",
    "undrawn_line": "jac",
    "tiny_baseline": "baseline",
}
MENDABLE = ("wrong_label", "swapped_sides", "bad_point", "missing_ball", "undrawn_line")


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    made = zip(LESSONS, make_practice_scenes(), strict=True)
    return {lesson.kind: scene for lesson, scene in made}


@pytest.fixture(scope="module")
def solved(scenes: dict[str, Scene]) -> dict[str, Solution]:
    return {kind: solve_group(scene.group, PAPER) for kind, scene in scenes.items()}


class TestLessons:
    def test_every_kind_of_fault_and_a_sound_group_are_there_once(self):
        kinds = [lesson.kind for lesson in LESSONS]
        assert sorted(kinds) == sorted([CLEAN, *PRACTICE_KINDS])
        assert len(kinds) == 8

    def test_stand_in_the_order_of_their_numbers(self):
        numbers = [lesson.number for lesson in LESSONS]
        assert numbers == sorted(numbers)

    @pytest.mark.parametrize("kind", FAILS)
    def test_each_fails_the_gate_that_it_is_about(self, solved: dict[str, Solution], kind: str):
        failing = solved[kind].first_failing
        assert (failing.name if failing else None) == FAILS[kind]

    @pytest.mark.parametrize("kind", FAILS)
    def test_each_carries_the_fault_that_it_is_about(self, scenes: dict[str, Scene], kind: str):
        kinds = {fault.kind for fault in scenes[kind].truth.faults}
        assert kinds == (set() if kind == CLEAN else {kind})

    def test_the_sound_group_has_nothing_to_look_at(self, solved: dict[str, Solution]):
        assert solved[CLEAN].passes
        assert solved[CLEAN].findings == ()

    @pytest.mark.parametrize(
        ("kind", "finding"),
        [
            ("wrong_label", "wrong_label"),
            ("swapped_sides", "sides_swapped"),
            ("not_synchronous", "not_synchronous"),
            ("undrawn_line", "visible_not_annotated"),
        ],
    )
    def test_the_solver_points_at_it(self, solved: dict[str, Solution], kind: str, finding: str):
        assert finding in {item.kind for item in solved[kind].findings}

    @pytest.mark.parametrize("kind", MENDABLE)
    def test_what_was_there_before_the_fault_mends_it(self, scenes: dict[str, Scene], kind: str):
        lesson = next(item for item in LESSONS if item.kind == kind)
        sound = make_scene(make_practice_match(), lesson.number, None)
        spoilt = scenes[kind].group
        views = [replace(view, media=None) for view in spoilt.views]
        views[lesson.view] = sound.group.views[lesson.view]
        mended = replace(spoilt, views=tuple(views))
        assert solve_group(mended, PAPER).passes

    def test_undrawn_lines_are_long_and_straight(self, scenes: dict[str, Scene]):
        scene = scenes["undrawn_line"]
        for fault in scene.truth.faults:
            truth = scene.truth.view(fault.view)
            view = scene.group.view(fault.view)
            assert truth is not None
            assert view is not None
            assert fault.marking not in view.station.lines
            curve = truth.camera.project(scene.group.pitch.sample(fault.marking, 0.2, 0.2))
            seen = (curve > 0).all(axis=1) & (curve < [1280, 720]).all(axis=1)
            assert np.ptp(curve[seen], axis=0).max() > 200


class TestWritePractice:
    def test_writes_frames_labels_and_the_truth(self, tmp_path: Path, monkeypatch):
        # What a frame looks like is the renderer's own test.
        blank = np.zeros((8, 8, 3), np.uint8)
        monkeypatch.setattr("app.features.practice.lessons.render_view", lambda _scene, _key: blank)
        said: list[tuple[int, int]] = []
        write_practice(tmp_path, lambda done, total: said.append((done, total)))
        truths = read_truth(tmp_path)
        assert len(truths) == len(LESSONS)
        frames = sum(len(truth.views) for truth in truths.values())
        assert said[-1] == (frames, frames)
        archive = next(tmp_path.rglob(ARCHIVE))
        assert len(zipfile.ZipFile(archive).namelist()) == frames
