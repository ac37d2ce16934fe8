"""A camera solved from stored paint: no picture is there, and none is needed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.features.groups.solution_schemas import camera_sigma
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.polyline import clip_polyline
from app.soccer.annotation import make_lines
from app.soccer.finding import SuggestedFix
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.paint_evidence import PaintEvidence, PaintPoint, PaintReading
from app.soccer.picture import OPEN
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import PAPER, TOUCHLINE
from app.solving.calibrate import (
    calibrate_view,
    compute_paint_search_key,
    compute_view_calibration_key,
)
from app.solving.paint_camera import write_paint_step
from app.solving.solve import solve_group
from tests.balls import box_around
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, click

SIGMA_PX = 0.08
BALL = np.array([34.0, -2.0, -1.0])
TOLD = TOUCHLINE.calibration
CLICKS = replace(TOLD, source="lines")


def painted(camera: Camera, moved_px: float = 0.0, pitch: Pitch | None = None) -> PaintEvidence:
    """Paint every few pixels along each marking that a camera sees, to a tenth of a pixel."""
    generator = np.random.default_rng(5)
    points = {}
    for marking in sorted(MARKINGS):
        if marking.startswith("Goal"):
            continue
        places = (pitch or Pitch()).sample(marking, 0.3, 0.1)
        seen = clip_polyline(camera.project(places), SIZE.width, SIZE.height)
        if len(seen) < 10:
            continue
        near = seen[:: max(len(seen) // 40, 1)] + generator.normal(0, SIGMA_PX, (1, 2))
        near = near + generator.normal(0, SIGMA_PX, near.shape) + moved_px
        points[marking] = tuple(PaintPoint(x, y, SIGMA_PX) for x, y in near.round(4).tolist())
    return PaintEvidence(points)


MIDDLE = Pitch(goal="middle")
"""Goals where people click them, as the policy fits them."""


@cache
def clicked() -> Group:
    """Two views with clicks that are a pixel off."""
    views = tuple(
        View(
            key,
            Station(key, SIZE, lines=click(camera, 1.0, seed, MIDDLE)),
            (box_around(camera, BALL),),
        )
        for seed, (key, camera) in enumerate((("a", MAIN), ("b", BEHIND_GOAL)))
    )
    return Group("g", views)


def read(group: Group, **changes) -> Group:
    """The group, the paint of whose first picture was read."""
    view = group.views[0]
    key = compute_paint_search_key(group, view, CLICKS)
    reading = PaintReading("f" * 32, key, painted(MAIN), None, 0.9, 0.8)
    return replace(group, paint={view.key: replace(reading, **changes)})


def first(group: Group, policy=TOLD):
    return calibrate_view(group, group.views[0], policy)


def off(calibration) -> float:
    return float(np.linalg.norm(calibration.camera.position - MAIN.position))


class TestCamera:
    def test_it_lies_where_the_paint_lies_and_its_covariance_holds_the_truth(self):
        clicks, found = first(clicked()), first(read(clicked()))
        assert (clicks.source, found.source) == ("lines", "paint")
        assert off(found) < off(clicks) / 2
        covariance = np.reshape(found.covariance, (8, 8))[3:6, 3:6]
        moved = found.camera.position - MAIN.position
        assert moved @ np.linalg.solve(covariance, moved) < 16.3
        assert found.position_sigma_m < clicks.position_sigma_m / 3

    def test_files_and_documents_know_that_no_pitch_is_quite_the_plan(self):
        """No click and no paint tells a crowned or a longer pitch from another camera."""
        found = first(read(clicked()))
        told, own = (np.sqrt(np.diag(np.reshape(item, (8, 8))))[3:6] for item in (
            found.known_covariance_with_pitch, found.covariance
        ))  # fmt: skip
        assert 0.5 < np.linalg.norm(told) < 2 and np.linalg.norm(own) < 0.3
        assert camera_sigma(found, SIZE).position_meters == pytest.approx(tuple(told))

    def test_paint_of_a_pitch_by_the_laws_is_fitted_where_the_policy_says_so(self):
        pitch, apart = Pitch(goal="laws"), {}
        for policy in (TOLD, replace(TOLD, goal="laws")):
            group = clicked()
            key = compute_paint_search_key(group, group.views[0], replace(policy, source="lines"))
            reading = PaintReading("f" * 32, key, painted(MAIN, pitch=pitch), None, 0.9, 0.8)
            found = first(replace(group, paint={group.views[0].key: reading}), policy)
            assert found.source == "paint"
            apart[policy.goal] = found.paint.error_px
        assert apart["laws"] < SIGMA_PX < apart["middle"], apart

    def test_it_says_how_both_agree_and_is_measured_against_the_clicks(self):
        clicks, found = first(clicked()), first(read(clicked()))
        assert (found.paint.supported, found.paint.explained) == (0.9, 0.8)
        assert found.paint.points > 200 and found.paint.error_px < 2 * SIGMA_PX
        assert found.jac is not None and found.error_px != clicks.error_px

    def test_the_same_paint_gives_the_same_bits(self):
        assert first(read(clicked())) == first(read(clicked()))

    def test_what_the_clicks_know_holds_what_the_paint_leaves_open(self):
        whole = painted(MAIN)
        name = max(whole.points, key=lambda marking: len(whole.points[marking]))
        few = first(read(clicked(), evidence=PaintEvidence({name: whole.points[name]})))
        clicks = first(clicked())
        assert few.source == "paint"
        assert off(few) < off(clicks) + 3 * clicks.position_sigma_m

    @pytest.mark.parametrize("reason", ["no_paint", "paint_disagrees", "no_frame"])
    def test_where_a_reason_was_read_the_clicks_stay(self, reason):
        found = first(read(clicked(), reason=reason))
        assert (found.source, found.paint.reason) == ("lines", reason)
        assert replace(found, paint=None) == first(clicked())

    def test_paint_that_contradicts_the_clicks_moves_nothing(self):
        found = first(read(clicked(), evidence=painted(MAIN, moved_px=25.0)))
        assert (found.source, found.paint.reason) == ("lines", "paint_disagrees")
        assert found.camera == first(clicked()).camera

    def test_a_camera_that_its_clicks_do_not_allow_is_not_taken_however_well_it_fits(self):
        pan, tilt, roll = np.radians(MAIN.pan_tilt_roll_degrees)
        turned = replace(MAIN, rotation=rotation_from_pan_tilt_roll(pan + 0.003, tilt, roll))
        found = first(read(clicked(), evidence=painted(turned)))
        assert (found.source, found.paint.reason) == ("lines", "paint_disagrees")

    def test_without_a_place_of_paint_the_clicks_stay(self):
        found = first(read(clicked(), evidence=PaintEvidence({})))
        assert (found.source, found.paint.reason) == ("lines", "paint_disagrees")


class TestKey:
    def test_the_policy_of_lines_knows_nothing_of_paint(self):
        group = read(clicked())
        view = group.views[0]
        for policy in (CLICKS, PAPER.calibration):
            assert compute_view_calibration_key(
                group, view, policy
            ) == compute_view_calibration_key(clicked(), view, policy)
            assert first(group, policy) == first(clicked(), policy)

    def test_paint_that_was_not_read_leaves_the_key_of_the_clicks(self):
        view = clicked().views[0]
        assert compute_view_calibration_key(clicked(), view, TOLD) == compute_view_calibration_key(
            clicked(), view, CLICKS
        )

    def test_what_counts_as_missing_leaves_paint_as_it_was_read(self):
        """It changes how a camera is measured, and no camera."""
        group = read(clicked())
        view = group.views[0]
        hidden = replace(view, station=replace(view.station, not_visible=("Circle left",)))
        hiding = group.with_view(hidden)
        for shortest in (0.0, 5.0, 9.0):
            policy = replace(TOLD, shortest_marking_px=shortest)
            found, other = first(group, policy), first(hiding, policy)
            assert found.source == other.source == "paint"
            assert found.camera == other.camera == first(group).camera
        keys = {
            compute_view_calibration_key(group, view, replace(TOLD, shortest_marking_px=shortest))
            for shortest in (0.0, 5.0)
        }
        assert len(keys) == 2

    def test_paint_that_was_read_before_stays_known(self):
        """Stored readings name the key that all of a calibration had before."""
        lines = {"Middle line": [ImagePoint(480.0, 100.5), ImagePoint(490.25, 500.0)]}
        station = Station("a", ImageSize(960, 540), lines=make_lines(lines))
        group = Group("g", (View("a", station, ()),))
        before = replace(TOLD, goal="inner", weighed="points")
        assert (
            compute_paint_search_key(group, group.views[0], before)
            == "5e1cff3d68f54b070aa1f12d1f685e29"
        )

    def test_the_noise_that_a_dataset_shows_moves_no_camera_and_makes_no_reading_stale(self):
        group, noise = clicked(), {"line_sigma_px": 2.5, "line_share": 0.4}
        quiet, noisy = compute_paint_search_key(group, group.views[0], TOLD), replace(TOLD, **noise)
        assert compute_paint_search_key(group, group.views[0], noisy) == quiet
        found, other = first(group, CLICKS), first(group, replace(CLICKS, **noise))
        assert found.camera == other.camera and found.covariance != other.covariance

    def test_the_camera_of_the_clicks_is_what_its_version_says(self):
        """A change here asks for another ``START_VERSION``."""
        for weighed, position in (
            ("points", [2.85597, 62.14639, -16.02059]),
            ("markings", [2.79232, 62.24884, -16.05401]),
        ):
            camera = first(clicked(), replace(CLICKS, weighed=weighed)).camera
            assert camera.position == pytest.approx(position, abs=1e-3)

    def test_each_reading_has_a_key_of_its_own(self):
        groups = (clicked(), read(clicked()), read(clicked(), supported=0.5))
        assert (
            len({compute_view_calibration_key(group, group.views[0], TOLD) for group in groups})
            == 3
        )

    def test_a_reading_for_other_lines_does_not_count(self):
        group = read(clicked())
        view = group.views[0]
        fewer = dict(view.station.lines)
        fewer.pop("Middle line", None)
        fewer.popitem()
        edited = group.with_view(replace(view, station=replace(view.station, lines=fewer)))
        assert first(edited) == first(replace(edited, paint={}))
        assert first(edited).paint is None

    @pytest.mark.parametrize(
        "changes", [{"shared": True}, {"given": MAIN}, {"picture": OPEN}], ids=lambda item: [*item]
    )
    def test_static_given_and_changed_pictures_take_no_paint(self, changes):
        view = clicked().views[0]
        bare = clicked().with_view(replace(view, station=replace(view.station, **changes)))
        painted = read(bare)
        assert first(painted).source != "paint"
        assert first(painted) == first(bare)
        assert compute_view_calibration_key(
            painted, painted.views[0], TOLD
        ) == compute_view_calibration_key(bare, bare.views[0], TOLD)


def kinds(group: Group, policy=TOUCHLINE):
    said = solve_group(group, policy).findings
    return {item.view: item for item in said if item.kind in ("no_paint", "paint_disagrees")}


class TestFindings:
    def test_the_policy_of_lines_asks_for_no_paint(self):
        assert kinds(clicked(), PAPER) == {}

    def test_a_picture_that_is_not_there_or_was_never_read_is_no_fault_of_the_group(self):
        assert kinds(read(clicked())) == {}
        assert kinds(clicked()) == {}
        lines = replace(TOUCHLINE, calibration=PAPER.calibration)
        assert solve_group(clicked(), TOUCHLINE).findings == solve_group(clicked(), lines).findings

    def test_lines_that_changed_since_ask_for_another_reading(self):
        group = read(clicked(), sought_for="another")
        found = kinds(group)["a"]
        assert "changed since its paint was read" in found.sentence
        assert found.fix == SuggestedFix("read_paint", "a")

    @pytest.mark.parametrize(
        ("reason", "kind", "words", "fix"),
        [
            ("no_paint", "no_paint", "Too little paint", None),
            ("no_frame", "no_paint", "missing", SuggestedFix("read_paint", "a")),
            ("paint_disagrees", "paint_disagrees", "does not lie where", None),
        ],
    )
    def test_each_reason_is_told_and_where_reading_helps_it_is_proposed(
        self, reason, kind, words, fix
    ):
        found = kinds(read(clicked(), reason=reason))["a"]
        assert (found.kind, words in found.sentence, found.fix) == (kind, True, fix)


class TestSolve:
    def test_a_known_calibration_of_clicks_or_paint_changes_no_bit(self):
        group = read(clicked())
        whole = solve_group(group, TOUCHLINE)
        known = {
            view.calibration_key: view.calibration
            for policy in (replace(TOUCHLINE, calibration=CLICKS), TOUCHLINE)
            for view in solve_group(group, policy).views
        }
        assert len(known) == 3
        assert solve_group(group, TOUCHLINE, known) == whole

    def test_the_ball_is_where_it_is_more_exactly(self):
        group = read(clicked())
        before, after = solve_group(group, PAPER).ball, solve_group(group, TOUCHLINE).ball
        assert after.sigma_m < before.sigma_m


SOFT_PX, SIGMAS, STRICT_PX, DAMPING, ROUNDS = 1.0, 4.0, 0.3, 1e-4, 4


def step_in_numpy(offsets, sigmas, base, jacobian, information, pull, strict):
    moved = np.zeros(8)
    for _ in range(ROUNDS):
        rest = offsets - jacobian @ moved
        if strict:
            robust = (1 + (rest / np.maximum(SIGMAS * sigmas, STRICT_PX)) ** 2) ** -2.0
        else:
            robust = 1 / np.sqrt(1 + (rest / SOFT_PX) ** 2)
        normal = jacobian.T @ ((base * robust)[:, None] * jacobian) + information
        normal[np.diag_indices(8)] *= 1 + DAMPING
        moved = np.linalg.solve(normal, jacobian.T @ (base * robust * offsets) + pull)
    return moved


def problem(seed=5):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(60, 8)) * [900, 700, 300, 9, 9, 12, 400, 60]
    offsets = jacobian @ (rng.normal(size=8) * 1e-3) + rng.normal(size=60) * 0.1
    # Some of it is a player's sock.
    offsets[:6] += 5.0
    sigmas = rng.uniform(0.05, 0.4, 60)
    information = np.diag(rng.uniform(0.1, 4.0, 8))
    return offsets, sigmas, sigmas**-2.0, jacobian, information, rng.normal(size=8)


def step_of(parts, strict):
    moved = np.empty(8)
    write_paint_step(*parts, ROUNDS, DAMPING, strict, SOFT_PX, SIGMAS, STRICT_PX, moved)
    return moved


@pytest.mark.parametrize("strict", [False, True])
def test_the_step_is_that_of_reweighted_least_squares(strict):
    parts = problem()
    assert step_of(parts, strict) == pytest.approx(step_in_numpy(*parts, strict), rel=1e-9)


def test_what_lies_far_off_hardly_moves_a_strict_step():
    offsets, sigmas, base, *others = parts = problem()
    without = step_of((offsets, sigmas, base * (np.arange(60) >= 6), *others), strict=True)
    strict, soft = (
        np.abs(parts[3] @ (step_of(parts, strict=each) - without)).max() for each in (True, False)
    )
    assert strict < 0.05
    assert soft > 5 * strict


def test_a_step_that_nothing_determines_is_an_error():
    offsets, sigmas, base, jacobian, *_ = problem()
    jacobian[:, 2] = 0.0
    nothing = np.zeros((8, 8)), np.zeros(8)
    with pytest.raises(np.linalg.LinAlgError):
        step_of((offsets, sigmas, base, jacobian, *nothing), strict=False)
