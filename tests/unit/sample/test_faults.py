from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.sample.cameras import PITCH
from app.sample.faults import (
    BALL_SHIFT_M,
    POINT_SHIFT_PX,
    TINY_BASELINE_M,
    FaultPlan,
    list_confusable_markings,
    plant_annotation_fault,
)
from app.sample.scene import FAULT_KINDS, PlantedFault, Scene
from app.soccer.annotation import make_lines
from app.soccer.group import View
from app.soccer.pitch import MARKINGS, opposite_marking
from tests.scenes import make_scenes


def _with_fault(scenes: list[Scene], kind: str) -> Iterator[tuple[Scene, PlantedFault, View]]:
    found = 0
    for scene in scenes:
        for fault in scene.truth.faults:
            if fault.kind == kind:
                view = scene.group.view(fault.view)
                assert view is not None
                found += 1
                yield scene, fault, view
    assert found > 0


def _distance(scene: Scene, view: View, marking: str, point: tuple[float, float]) -> float:
    """Pixels from a point to where the true camera shows the marking."""
    curve = scene.truth.view(view.key).camera.project(PITCH.sample(marking, 0.05, 0.05))
    offsets = curve[np.isfinite(curve[:, 0])] - point
    return float(np.linalg.norm(offsets, axis=1).min(initial=np.inf))


class TestPlanFault:
    def test_about_a_third_of_the_groups_carry_one_fault(self, faulty_scenes: list[Scene]):
        counts = [len(scene.truth.faults) for scene in faulty_scenes]
        assert set(counts) == {0, 1}
        assert 0.22 < np.mean(counts) < 0.45

    def test_every_kind_occurs(self, faulty_scenes: list[Scene]):
        kinds = {fault.kind for scene in faulty_scenes for fault in scene.truth.faults}
        assert kinds == set(FAULT_KINDS)

    def test_groups_without_a_fault_are_the_same_with_faults_switched_off(self):
        faulty, clean = make_scenes(12, 4, faults=True), make_scenes(12, 4, faults=False)
        same = [
            a.group == b.group for a, b in zip(faulty, clean, strict=True) if not a.truth.faults
        ]
        assert len(same) > 4
        assert all(same)
        assert not any(scene.truth.faults for scene in clean)


class TestBadPoint:
    def test_one_point_lies_far_from_its_marking(self, faulty_scenes: list[Scene]):
        for scene, fault, view in _with_fault(faulty_scenes, "bad_point"):
            points = view.station.lines[fault.marking]
            away = [_distance(scene, view, fault.marking, point) for point in points]
            assert POINT_SHIFT_PX[0] <= fault.amount <= POINT_SHIFT_PX[1]
            assert away[fault.index] > POINT_SHIFT_PX[0] - 8
            assert max([*away[: fault.index], *away[fault.index + 1 :]]) < 7


class TestSwappedSides:
    def test_the_twin_of_every_label_fits(self, faulty_scenes: list[Scene]):
        for scene, _, view in _with_fault(faulty_scenes, "swapped_sides"):
            for marking, points in view.station.lines.items():
                assert _distance(scene, view, opposite_marking(marking), points[0]) < 7

    def test_only_replays_are_swapped(self, faulty_scenes: list[Scene]):
        for scene, fault, _ in _with_fault(faulty_scenes, "swapped_sides"):
            assert fault.view != scene.group.views[0].key


class TestNotSynchronous:
    def test_ball_and_players_are_elsewhere(self, faulty_scenes: list[Scene]):
        for scene, fault, view in _with_fault(faulty_scenes, "not_synchronous"):
            true = scene.truth.view(view.key)
            moved = np.linalg.norm(np.subtract(true.ball, scene.truth.ball))
            assert moved == pytest.approx(fault.amount)
            assert moved > BALL_SHIFT_M[0] * 0.9
            main = scene.instants[scene.group.views[0].key]
            assert np.abs(scene.instants[view.key].feet - main.feet).max() > 0.5

    def test_the_annotated_ball_is_the_one_of_its_own_moment(self, faulty_scenes: list[Scene]):
        for scene, _, view in _with_fault(faulty_scenes, "not_synchronous"):
            true = scene.truth.view(view.key)
            shown = true.camera.project(np.array([true.ball]))[0]
            assert view.ball.center == pytest.approx(shown, abs=4)
            elsewhere = true.camera.project(np.array([scene.truth.ball]))[0]
            assert np.linalg.norm(np.subtract(view.ball.center, elsewhere)) > 8


class TestTinyBaseline:
    def test_the_replay_stands_next_to_the_main_camera(self, faulty_scenes: list[Scene]):
        for scene, fault, view in _with_fault(faulty_scenes, "tiny_baseline"):
            main = scene.truth.views[0].camera.position
            distance = np.linalg.norm(scene.truth.view(view.key).camera.position - main)
            assert distance == pytest.approx(fault.amount)
            assert TINY_BASELINE_M[0] <= distance <= TINY_BASELINE_M[1]


class TestMissingBall:
    def test_one_view_has_no_ball_and_the_others_have_one(self, faulty_scenes: list[Scene]):
        for scene, _, view in _with_fault(faulty_scenes, "missing_ball"):
            assert view.ball is None
            assert (
                sum(other.ball is not None for other in scene.group.views)
                == len(scene.group.views) - 1
            )


class TestWrongLabel:
    def test_the_clicks_fit_the_true_marking_and_not_the_named_one(
        self, faulty_scenes: list[Scene]
    ):
        for scene, fault, view in _with_fault(faulty_scenes, "wrong_label"):
            points = view.station.lines[fault.marking]
            assert fault.true_marking not in view.station.lines
            assert max(_distance(scene, view, fault.true_marking, p) for p in points) < 7
            assert max(_distance(scene, view, fault.marking, p) for p in points) > 20

    def test_where_every_name_is_taken_the_wrong_clicks_replace_the_right_ones(
        self, faulty_scenes: list[Scene]
    ):
        view = faulty_scenes[0].group.views[0]
        everything = {name: ((i, 2.0), (i + 100.0, 3.0)) for i, name in enumerate(MARKINGS)}
        full = replace(view, station=replace(view.station, lines=make_lines(everything)))
        spoilt, fault = plant_annotation_fault(FaultPlan("wrong_label", 0, 1), full)
        assert fault.true_marking not in spoilt.station.lines
        assert spoilt.station.lines[fault.marking] == full.station.lines[fault.true_marking]


class TestConfusions:
    def test_every_marking_can_be_taken_for_another(self):
        for marking in MARKINGS:
            names = list_confusable_markings(marking)
            assert names
            assert marking not in names
            assert set(names) <= set(MARKINGS)
