"""Main cameras of a match on their paint know together which pitch they show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.errors import InputError
from app.geometry.resection import X, Y, Z, camera_from_parameters
from app.soccer.group import Group, Station, View
from app.soccer.paint_evidence import (
    PaintEvidence,
    PaintPoint,
    PaintReading,
    reading_from_canonical_json,
    reading_from_json,
    reading_to_json,
)
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import TOUCHLINE
from app.solving.calibrate import (
    calibrate_view,
    compute_paint_search_key,
    compute_view_calibration_key,
)
from app.solving.match_tripod import add_match_tripod_to_readings
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, click
from tests.unit.solving.test_tripod_pitch import CENTER, HALF, WITHIN, laid, painted, posed

POLICY = TOUCHLINE.calibration
SHORT, CROWNED = Pitch(101, 68), laid(crown=0.15)
POSITION = slice(X, Z + 1)


def group_of(number: int, truth: np.ndarray) -> Group:
    """A group of one view, clicked on the plan and with the paint of a short pitch with a crown."""
    frame = painted(truth, SHORT, CROWNED, np.random.default_rng(number))
    marking, pixels = frame.sightings.curve, frame.sightings.pixels + CENTER
    points = {
        MARKINGS[index]: tuple(
            PaintPoint(x, y, 0.1) for x, y in pixels[marking == index].round(4).tolist()
        )
        for index in np.unique(marking)
    }
    on_plan = camera_from_parameters(frame.parameters, MAIN.principal_point, HALF)
    lines = click(on_plan, 1.0, number, Pitch(goal="middle"))
    group = Group(f"{number}", (View("a", Station(f"{number}", SIZE, lines=lines)),), match="m")
    key = compute_paint_search_key(group, group.views[0], POLICY)
    evidence = PaintEvidence({name: points[name] for name in sorted(points)})
    return replace(group, paint={"a": PaintReading("f" * 32, key, evidence, None, 0.9, 0.8)})


@cache
def match() -> tuple[dict[int, np.ndarray], dict[int, Group]]:
    """True cameras and groups of a match, by id."""
    truths = {number: posed(pan) for number, pan in enumerate((-22.0, -8.0, 8.0, 22.0), start=1)}
    return truths, {number: group_of(number, truth) for number, truth in truths.items()}


def with_reading(group: Group, reading: PaintReading) -> Group:
    return replace(group, paint={"a": reading})


def off_and_covariance(group: Group, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    found = calibrate_view(group, group.views[0], POLICY)
    assert found.source == "paint"
    covariance = np.reshape(found.known_covariance_with_pitch, (8, 8))[POSITION, POSITION]
    return found.camera.position - truth[POSITION], covariance


def test_their_covariance_knows_how_far_the_plan_puts_them_off_and_no_camera_moves():
    truths, groups = match()
    found = add_match_tripod_to_readings(groups, POLICY)
    assert found.keys() == groups.keys()
    off_plan = []
    for number, group in groups.items():
        together = with_reading(group, found[number])
        off, covariance = off_and_covariance(together, truths[number])
        assert off @ np.linalg.solve(covariance, off) < WITHIN**2
        assert (off == off_and_covariance(group, truths[number])[0]).all()
        assert compute_view_calibration_key(
            together, together.views[0], POLICY
        ) != compute_view_calibration_key(group, group.views[0], POLICY)
        off_plan.append(np.linalg.norm(off))
    assert np.mean(off_plan) > 0.5


def test_the_covariance_of_the_rays_of_a_ball_stays():
    """What all cameras of a match have in common says nothing of how their rays miss each other."""
    _, groups = match()
    together = with_reading(groups[1], add_match_tripod_to_readings(groups, POLICY)[1])
    found, alone = (calibrate_view(each, each.views[0], POLICY) for each in (together, groups[1]))
    assert found.covariance == alone.covariance
    assert found.pitch_covariance != alone.pitch_covariance


def test_what_they_knew_together_before_has_no_part_in_it():
    _, groups = match()
    found = add_match_tripod_to_readings(groups, POLICY)
    again = {number: with_reading(group, found[number]) for number, group in groups.items()}
    assert add_match_tripod_to_readings(again, POLICY) == found


def test_two_frames_know_nothing_together_and_lose_what_three_knew():
    _, groups = match()
    found = add_match_tripod_to_readings(groups, POLICY)
    two = {number: with_reading(groups[number], found[number]) for number in (1, 2)}
    assert [item.tripod for item in add_match_tripod_to_readings(two, POLICY).values()] == [
        None,
        None,
    ]


@pytest.mark.parametrize(
    ("like", "axis", "metres"), [(3, Y, 14.0), (3, Y, 8.0), (2, Y, -8.0), (2, X, -6.0)]
)
def test_a_frame_of_another_camera_is_left_alone(like, axis, metres):
    truths, groups = match()
    elsewhere = truths[like].copy()
    elsewhere[axis] += metres
    found = add_match_tripod_to_readings({**groups, 9: group_of(9, elsewhere)}, POLICY)
    assert found[9].tripod is None
    assert all(found[number].tripod is not None for number in groups)


def test_paint_that_was_read_for_other_lines_takes_no_part():
    _, groups = match()
    stale = with_reading(groups[1], replace(groups[1].paint["a"], sought_for="other"))
    assert 1 not in add_match_tripod_to_readings({**groups, 1: stale}, POLICY)


def test_it_is_kept_as_json_to_the_last_bit_and_anything_else_is_refused():
    _, groups = match()
    reading = add_match_tripod_to_readings(groups, POLICY)[1]
    assert reading_from_canonical_json(reading.canonical_json) == reading
    value = reading_to_json(reading)
    assert "tripod" not in reading_to_json(groups[1].paint["a"])
    for wrong in ([[1.0], [2.0]], [[float("nan")] * 8, [0.0] * 64], "no"):
        with pytest.raises(InputError, match="this is not a valid paint measurement"):
            reading_from_json({**value, "tripod": wrong})
