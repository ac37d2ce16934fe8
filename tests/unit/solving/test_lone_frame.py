"""Frames of whose pitch and picture nobody says anything: how far their cameras may be off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from app.features.solutions.codec import from_json, to_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.group import Group, Station, View
from app.soccer.paint_evidence import PAINT_DISAGREES, PaintEvidence, PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, STRICT, TOUCHLINE, CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import (
    add_lone_frame_uncertainty,
    analyse_lone_frame,
    calibrate,
    calibrate_view,
    compute_paint_search_key,
    compute_view_calibration_keys,
)
from app.solving.calibration_findings import find_calibration_findings
from app.solving.lone_frame import PRIORS, LoneFrameUncertainty
from app.solving.solve import solve_group
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, PITCH, click

ANY = replace(PAPER.calibration, lone_frames="any")
WIDE = looking((3.0, 66.0, -18.0), (24.0, -2.0, 0.0), 1500.0, bend=0.02)
"""Shows the middle line and an end, a touchline and an area: it tells both sizes."""
END = looking((3.0, 62.0, -16.0), (44.0, 0.0, 0.0), 3400.0, bend=0.02)
"""Shows an end alone."""
INSIDE = float(chi2.ppf(0.95, 3))


def alone(
    lines: Lines, policy: CalibrationPolicy = ANY
) -> tuple[Camera, FloatArray, LoneFrameUncertainty]:
    """The camera, its covariance by the clicks, and what nobody says of the frame."""
    found = calibrate(lines, PITCH, SIZE, policy)
    lone = analyse_lone_frame(found, lines, PITCH, SIZE, policy)
    assert found.camera is not None and found.covariance is not None and lone is not None
    return found.camera, np.reshape(found.covariance, (8, 8)), lone


def off_by(camera: Camera, truth: Camera, covariance: FloatArray) -> float:
    """Squared distance of a position from the true one, in its own sigmas."""
    apart = camera.position - truth.position
    return float(apart @ np.linalg.solve(covariance[3:6, 3:6], apart))


class TestLoneFrame:
    @pytest.mark.parametrize("size", [(100.0, 68.0), (98.0, 60.0), (112.0, 75.0)])
    def test_on_another_pitch_the_truth_is_within_reach(self, size: tuple[float, float]) -> None:
        camera, clicked, lone = alone(click(WIDE, 1.0, 3, Pitch(*size)))
        assert off_by(camera, WIDE, clicked) > INSIDE
        assert off_by(camera, WIDE, lone.covariance) < INSIDE

    def test_lines_that_tell_the_pitch_are_heard(self) -> None:
        _, _, lone = alone(click(WIDE, 1.0, 3, Pitch(100.0, 66.0)))
        found = lone.find_other_pitch(PITCH)
        assert found is not None
        assert found.size == pytest.approx((100.0, 66.0), abs=1.0)
        assert (lone.sizes_sigma < 1.0).all()

    def test_on_the_pitch_in_use_no_other_is_told(self) -> None:
        for seed in range(5):
            _, _, lone = alone(click(WIDE, 1.0, seed))
            assert lone.find_other_pitch(PITCH) is None
            assert (np.abs([lone.pitch.length - 105, lone.pitch.width - 68]) < 1.5).all()

    def test_an_end_alone_leaves_the_length_open(self) -> None:
        _, clicked, lone = alone(click(END, 1.0))
        assert lone.sizes_sigma[0] == pytest.approx(PRIORS["any"][0], rel=0.1)
        assert np.sqrt(clicked[3, 3]) < 1.0
        # The centre of the pitch lies half of it away from what is seen.
        assert np.sqrt(lone.covariance[3, 3]) > 0.5 * 0.9 * PRIORS["any"][0]

    def test_professional_pitches_leave_less_open(self) -> None:
        lines = click(END, 1.0)
        spreads = [
            np.trace(alone(lines, replace(ANY, lone_frames=word))[2].covariance[3:6, 3:6])
            for word in ("professional", "any")
        ]
        assert spreads[0] < 0.3 * spreads[1]

    @pytest.mark.parametrize("aspect", [4 / 3, 3 / 4])
    def test_in_a_stretched_picture_the_truth_is_within_reach(self, aspect: float) -> None:
        squeezed = PictureGeometry(aspect).camera_of_annotated_picture(WIDE, SIZE)
        told = [alone(click(squeezed, 1.0, seed)) for seed in range(10)]
        assert sum(off_by(camera, WIDE, clicked) < INSIDE for camera, clicked, _ in told) == 0
        assert sum(off_by(camera, WIDE, lone.covariance) < INSIDE for camera, _, lone in told) >= 8

    def test_markings_that_another_pitch_explains_are_no_wrong_labels(self) -> None:
        camera = looking((3.0, 62.0, -16.0), (26.0, -4.0, 0.0), 1900.0, bend=0.02)
        lines = click(camera, 1.0, 3, Pitch(95.0, 68.0))
        found = calibrate(lines, PITCH, SIZE, ANY)
        assert found.suspects
        lone = analyse_lone_frame(found, lines, PITCH, SIZE, ANY)
        assert lone is not None
        assert set(lone.explains) == {suspect.marking for suspect in found.suspects}
        assert lone.pitch.length == pytest.approx(95.0, abs=1.0)
        known = add_lone_frame_uncertainty(found, lone, PITCH)
        (finding,) = (
            item for item in find_calibration_findings(known, SIZE) if item.kind == "pitch_size"
        )
        assert f"{lone.explains[0]}" in finding.sentence

    def test_where_both_are_known_nothing_is_added(self) -> None:
        lines = click(WIDE, 1.0)
        found = calibrate(lines, PITCH, SIZE, PAPER.calibration)
        assert analyse_lone_frame(found, lines, PITCH, SIZE, PAPER.calibration) is None
        assert add_lone_frame_uncertainty(found, None, PITCH) is found
        assert PAPER.calibration.lone_frames == STRICT.calibration.lone_frames == "exact"

    def test_the_camera_itself_stays(self) -> None:
        lines = click(WIDE, 1.0, 3, Pitch(98.0, 64.0))
        found = calibrate(lines, PITCH, SIZE, ANY)
        lone = analyse_lone_frame(found, lines, PITCH, SIZE, ANY)
        told = add_lone_frame_uncertainty(found, lone, PITCH)
        assert told == replace(found, covariance=told.covariance, other_pitch=told.other_pitch)
        assert told.covariance != found.covariance


class TestOfDataset:
    def group(self, *views: View, match: str = "") -> Group:
        return Group("g", views, match=match)

    def view(self, key: str, camera: Camera = BEHIND_GOAL, **said: object) -> View:
        return View(key, Station(key, SIZE, lines=click(camera, 1.0), **said))  # type: ignore[arg-type]

    def sigma(self, group: Group, policy: CalibrationPolicy) -> float:
        found = calibrate_view(group, group.views[0], policy)
        assert found.position_sigma_m is not None
        return found.position_sigma_m

    def test_a_single_view_without_a_match_is_alone(self) -> None:
        group = self.group(self.view("a"))
        assert self.sigma(group, TOUCHLINE.calibration) > 2 * self.sigma(group, PAPER.calibration)
        key, clicks = compute_view_calibration_keys(group, group.views[0], TOUCHLINE.calibration)
        exact = replace(TOUCHLINE.calibration, lone_frames="exact")
        assert compute_view_calibration_keys(group, group.views[0], exact) == (clicks,) != (key,)

    def test_another_pitch_is_a_finding_of_its_view_and_is_kept_with_the_calibration(self) -> None:
        lines = click(WIDE, 1.0, 3, Pitch(98.0, 64.0))
        view = View("a", Station("a", SIZE, lines=lines), ())
        solution = solve_group(self.group(view), TOUCHLINE)
        (finding,) = (item for item in solution.findings if item.kind == "pitch_size")
        assert finding.view == "a" and finding.number > finding.threshold
        kept = from_json(Calibration, to_json(solution.views[0].calibration))
        assert kept == solution.views[0].calibration and kept.other_pitch is not None
        of_match = solve_group(self.group(view, match="m"), TOUCHLINE)
        assert "pitch_size" not in {item.kind for item in of_match.findings}

    @pytest.mark.parametrize("reason", ["no_paint", "no_frame", PAINT_DISAGREES])
    def test_is_alone_also_where_its_paint_says_nothing(self, reason: str, monkeypatch) -> None:
        monkeypatch.setattr("app.solving.calibrate.solve_paint", lambda *_: None)
        view, policy = self.view("a"), TOUCHLINE.calibration

        def with_reading(match: str) -> Group:
            group = self.group(view, match=match)
            sought_for = compute_paint_search_key(group, view, policy)
            told = None if reason == PAINT_DISAGREES else reason
            reading = PaintReading("", sought_for, PaintEvidence({}), told)
            return replace(group, paint={"a": reading})

        found = calibrate_view(with_reading(""), view, policy)
        unread = calibrate_view(self.group(view), view, policy)
        assert found.paint is not None
        assert (found.source, found.paint.reason) == ("lines", reason)
        assert found == replace(unread, paint=found.paint)
        assert self.sigma(with_reading("m"), policy) < unread.position_sigma_m / 2
        keys = [
            compute_view_calibration_keys(with_reading(name), view, policy) for name in ("", "m")
        ]
        assert keys[0][1] == keys[1][1] and keys[0][0] != keys[1][0]

    @pytest.mark.parametrize("kind", ["of a match", "two views", "said picture", "other pitch"])
    def test_others_are_as_they_were(self, kind: str) -> None:
        view = self.view("a")
        if kind == "said picture":
            view = self.view("a", picture=PictureGeometry())
        group = self.group(view, match="m" if kind == "of a match" else "")
        if kind == "two views":
            group = self.group(view, self.view("b", MAIN))
        if kind == "other pitch":
            group = replace(group, pitch=Pitch(104.0, 68.0))
        policies = (TOUCHLINE.calibration, replace(TOUCHLINE.calibration, lone_frames="exact"))
        assert self.sigma(group, policies[0]) == self.sigma(group, policies[1])
        keys = [compute_view_calibration_keys(group, group.views[0], policy) for policy in policies]
        assert keys[0] == keys[1]
