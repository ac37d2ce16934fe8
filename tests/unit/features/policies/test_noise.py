"""The noise of a dataset, and the policy that takes it over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.db.log import NewLogEntry, append_entries
from app.db.store import Store
from app.errors import DegenerateGeometryError, InputError, NotFoundError, StaleRevisionError
from app.features.datasets.queries import list_group_ids
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.edit_codec import edit_to_json
from app.features.groups.state import GroupState, read_states
from app.features.groups.submit import submit_edit
from app.features.imports.ingest import ensure_dataset, import_groups
from app.features.policies import noise
from app.features.policies.noise import (
    ASSUMED_WORDS,
    adopt_estimated_noise,
    adopt_estimated_noise_in_session,
    estimate_dataset_noise,
    reset_noise_factors,
)
from app.features.policies.service import change_policy, read_policy, replace_thresholds
from app.features.solutions import service as recompute
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.features.solve.jobs import solve_fully
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.policy import PAPER, TOUCHLINE, Policy, is_builtin_policy
from app.solving import dataset_noise
from app.solving.ball_covariance import CLICK_DIAGONAL
from app.solving.ball_noise import RayResidual
from app.solving.dataset_noise import GroupNoiseInputs
from app.solving.resect import REFERENCE_DIAGONAL
from tests.cameras import SIZE
from tests.unit.stores import BEHIND, MAIN, OPPOSITE, drawn

UNIT = SIZE.diagonal / CLICK_DIAGONAL
NOISY = 3.0
LINE_NOISY = 0.4
"""Of a point on a line, pixels at 960 x 540: less than what is assumed of an image alone."""


def blurred(key: str, rng: np.random.Generator, *, given: bool, noisy: str = "") -> Group:
    """A ball somewhere, clicked with noise in three views of known cameras, one of them noisier."""
    place = np.array([[rng.uniform(0, 10), rng.uniform(-5, 5), -1.0]])
    views = []
    for name, camera in (("a", MAIN), ("b", BEHIND), ("c", OPPOSITE)):
        x, y = camera.project(place)[0] + rng.normal(
            0, NOISY * UNIT * (4 if name == noisy else 1), 2
        )
        lines = {} if given else drawn(camera)
        known = camera if given else None
        station = Station(name, SIZE, shared=True, lines=lines, given=known)
        views.append(View(name, station, (BallAnnotation(point=ImagePoint(x, y)),)))
    return Group(key, tuple(views))


def own_lines(view: View, name: str, rng: np.random.Generator) -> View:
    """The view with a station of its own, its lines clicked anew."""
    camera = {"a": MAIN, "b": BEHIND, "c": OPPOSITE}[view.key]
    unit = SIZE.diagonal / REFERENCE_DIAGONAL
    lines = {
        marking: (np.array(points) + rng.normal(0, LINE_NOISY * unit, (len(points), 2))).tolist()
        for marking, points in drawn(camera).items()
        # Goals are drawn by their inner edges, and fitted by their middle but under ``paper``.
        if not marking.startswith("Goal")
    }
    return replace(view, station=Station(name, SIZE, lines=make_lines(lines)))


def placings(states: Sequence[GroupState]) -> Iterator[NewLogEntry]:
    """Ann placed every ball; then Bea those of every other group once more, and Cleo the others."""
    for state in states:
        for view in state.group.views:
            body = {"edit": edit_to_json(make_set_ball_edit(view.key, view.balls[0]))}
            for actor in ("ann", "bea" if state.id % 2 else "cleo"):
                yield NewLogEntry("edit", actor, "2026-01-01T00:00:00Z", body, 1, state.id)


def read_states_of(store: Store) -> list[GroupState]:
    """Every group of the first dataset."""
    with store.read() as session:
        return read_states(session, list_group_ids(session, 1))


def _spreads(store: Store) -> np.ndarray:
    """Sigma of each camera's position, metres."""
    states = read_states_of(store)
    found = [
        view.calibration for state in states if state.solution for view in state.solution.views
    ]
    return np.array([item.position_sigma_m for item in found])


def _mean_sigma(store: Store) -> float:
    """Of the balls, metres."""
    balls = [state.solution.ball for state in read_states_of(store) if state.solution]
    return float(np.mean([ball.sigma_m for ball in balls if ball is not None]))


def make(store: Store, *, given: bool) -> None:
    rng = np.random.default_rng(1)
    groups = [blurred(str(n), rng, given=given) for n in range(25)]
    import_groups(store, "demo", groups, source="test", actor="ann")
    solve_dataset(store, "demo")


class TestReadNoise:
    def test_clicks_noisier_than_the_policy_thinks_are_noticed(self, store: Store) -> None:
        make(store, given=False)
        found = estimate_dataset_noise(store, "demo")
        (advice,) = found.advice
        assert (advice.name, advice.present, advice.agrees) == ("click_sigma_px", 1.0, False)
        assert advice.low < advice.estimate < advice.high
        assert advice.estimate == pytest.approx(NOISY, rel=0.2)
        assert found.notices[0] == ASSUMED_WORDS and "too small" in found.notices[1]
        assert (found.groups, found.solved) == (25, 25)
        assert not found.follows

    def test_a_camera_and_a_person_with_noisier_balls_are_named(self, store: Store) -> None:
        rng = np.random.default_rng(5)
        groups = [blurred(str(n), rng, given=False, noisy="b") for n in range(40)]
        import_groups(store, "demo", groups, source="test", actor="ann")
        solve_dataset(store, "demo")
        with store.write() as session:
            append_entries(session, [*placings(read_states_of(store))])
        found = estimate_dataset_noise(store, "demo")
        worst, *rest = found.stations
        assert worst.source == "b" and not any(one.differs for one in rest if one.ratio > 1)
        assert worst.low < 4 * NOISY < worst.high and worst.differs
        assert {one.source for one in found.people} == {"bea", "cleo"}
        assert not any(one.differs for one in found.people)
        # Sigma of the balls of camera b follows once it is accepted, and nothing is new then.
        assert found.is_new and found.used == ()
        sigma = _mean_sigma(store)
        adopt_estimated_noise(store, found, actor="ben")
        carried = {view.noise for state in read_states_of(store) for view in state.group.views}
        assert carried <= {item.ratio for item in found.factors} and max(carried) > 1.5
        solve_dataset(store, "demo")
        again = estimate_dataset_noise(store, "demo")
        assert not again.is_new and again.used == found.factors
        assert _mean_sigma(store) > sigma
        with store.write() as session:
            assert reset_noise_factors(session, "demo", actor="ben") == 40
        assert {view.noise for state in read_states_of(store) for view in state.group.views} == {1}

    def test_lines_of_many_images_know_their_noise_together(self, store: Store) -> None:
        """A policy that leaves it to each image is told, and agrees once it has taken it over."""
        rng = np.random.default_rng(1)
        groups = [
            Group(str(n), tuple(own_lines(view, f"{n}{view.key}", rng) for view in group.views))
            for n in range(8)
            for group in [blurred(str(n), rng, given=False)]
        ]
        import_groups(store, "demo", groups, source="test", actor="ann")
        solve_dataset(store, "demo")
        found = estimate_dataset_noise(store, "demo")
        assert found.line_estimate is not None and found.line_estimate.views == 24
        advice = {item.name: item for item in found.advice}
        sigma, share = advice["calibration.line_sigma_px"], advice["calibration.line_share"]
        assert (sigma.present, sigma.agrees, share.present) == (None, False, None)
        assert sigma.low < LINE_NOISY < sigma.high and share.low <= 0.1
        assert "noise of lines per image" in " ".join(found.notices)
        before = _spreads(store)
        state = adopt_estimated_noise(store, found, actor="ben")
        assert state.policy.calibration.line_sigma_px == sigma.estimate
        assert len(list_stale_groups(store, state.dataset_id)) == 8
        solve_dataset(store, "demo")
        assert (_spreads(store) < before).mean() > 0.8
        again = estimate_dataset_noise(store, "demo")
        assert all(item.agrees for item in again.advice if "line" in item.name)

    def test_of_given_cameras_it_is_theirs(self, store: Store) -> None:
        make(store, given=True)
        found = estimate_dataset_noise(store, "demo")
        assert [item.name for item in found.advice] == ["given_sigma_px"]
        assert found.line_estimate is None

    def test_what_agrees_already_is_not_among_the_values_to_use(self, store: Store) -> None:
        make(store, given=False)
        found = estimate_dataset_noise(store, "demo")
        click = found.advice[0]
        agreeing = replace(click, present=click.estimate)
        open_one = replace(click, name="calibration.line_sigma_px", present=None)
        assert replace(found, advice=(agreeing,)).values == {}
        assert list(replace(found, advice=(agreeing, open_one)).values) == [open_one.name]

    def test_an_empty_dataset_says_that_nothing_is_known(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        found = estimate_dataset_noise(store, "demo")
        assert (found.advice, found.values, len(found.notices)) == ((), {}, 2)
        with pytest.raises(NotFoundError):
            estimate_dataset_noise(store, "nothing")

    @pytest.mark.parametrize("error", [np.linalg.LinAlgError, DegenerateGeometryError])
    def test_lines_that_leave_a_camera_open_are_passed_over(
        self, store: Store, monkeypatch: pytest.MonkeyPatch, error: type[Exception]
    ) -> None:
        make(store, given=False)

        def fails(*_: object) -> None:
            raise error("open")

        monkeypatch.setattr(dataset_noise, "collect_view_line_evidence", fails)
        found = estimate_dataset_noise(store, "demo")
        assert (found.line_estimate, len(found.advice)) == (None, 1)

    def test_what_is_put_into_the_policy_is_what_was_shown(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        make(store, given=False)
        rng = np.random.default_rng(2)
        misses = [
            RayResidual(rng.normal(0, np.hypot(0.5, 0.08 * size)), 1.0, size**2, 0.0, 0.0)
            for size in rng.uniform(5, 40, 600)
        ]
        shown = iter([misses])
        monkeypatch.setattr(GroupNoiseInputs, "ray_residuals", lambda *_: tuple(next(shown, ())))
        found = estimate_dataset_noise(store, "demo")
        click, share = found.advice
        assert (click.name, share.name, share.unit) == (
            "click_sigma_px",
            "box_sigma_share",
            "share",
        )
        assert share.low <= 0.08 <= share.high and share.present == 0.04 and not share.agrees
        assert found.values == {item.name: item.estimate for item in found.advice}
        assert not any("0.08 px" in sentence for sentence in found.notices)


class TestApplyNoise:
    @pytest.mark.parametrize("given", [False, True], ids=["lines", "given"])
    def test_the_policy_takes_it_over_and_agrees_from_then_on(
        self, store: Store, given: bool
    ) -> None:
        make(store, given=given)
        found = estimate_dataset_noise(store, "demo")
        state = adopt_estimated_noise(store, found, actor="ben")
        assert (state.policy.name, state.history[-1].actor) == ("custom", "ben")
        name = found.advice[0].name
        assert getattr(state.policy, name) == found.advice[0].estimate
        assert len(list_stale_groups(store, state.dataset_id)) == 25
        solve_dataset(store, "demo")
        again = estimate_dataset_noise(store, "demo")
        assert all(item.agrees for item in again.advice)
        assert (again.values, again.notices) == ({}, ())
        with pytest.raises(InputError, match="is what its policy already uses"):
            adopt_estimated_noise(store, again, actor="ben")

    @pytest.mark.parametrize("noise", ["estimated", "fixed"])
    def test_another_policy_that_was_chosen_meanwhile_is_not_overwritten(
        self, store: Store, noise: str
    ) -> None:
        make(store, given=False)
        policy = replace_thresholds(PAPER, {"noise": noise}, name="ours")
        change_policy(store, "demo", policy, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        found, state = estimate_dataset_noise(store, "demo"), read_policy(store, "demo")
        assert found.values
        theirs = replace_thresholds(policy, {"max_sigma_m": 0.31})
        change_policy(store, "demo", theirs, if_match=state.etag, actor="lea")
        with pytest.raises(StaleRevisionError), store.write() as session:
            adopt_estimated_noise_in_session(session, found, state, "ben")
        assert read_policy(store, "demo").policy.max_sigma_m == 0.31

    def test_a_second_estimate_is_the_first(self, store: Store) -> None:
        """Lines and balls are each known with the other's noise, not with what was used before."""
        make_lined(store)
        first = estimate_dataset_noise(store, "demo")
        adopt_estimated_noise(store, first, actor="ben")
        solve_dataset(store, "demo")
        again = estimate_dataset_noise(store, "demo")
        for one, other in zip(first.advice, again.advice, strict=True):
            assert other.estimate == pytest.approx(one.estimate, abs=0.011)
            assert (other.low, other.high) == pytest.approx((one.low, one.high), abs=0.011)


def make_lined(store: Store, policy: Policy = PAPER, groups: int = 10) -> None:
    """Groups with lines of their own, of little noise, and noisy balls; not solved by ``policy``."""
    rng = np.random.default_rng(1)
    made = [
        replace(group, views=tuple(own_lines(v, f"{n}{v.key}", rng) for v in group.views))
        for n in range(groups)
        for group in [blurred(str(n), rng, given=False)]
    ]
    import_groups(store, "demo", made, source="test", actor="ann", policy=policy)
    if policy is PAPER:
        solve_dataset(store, "demo")


def nobody(*_: object) -> None:
    """Nobody is told how far it is."""


class TestFollowing:
    """The policy ``touchline``, whose noise each solve of a dataset estimates."""

    def test_the_first_solve_uses_the_noise_of_the_dataset(self, store: Store) -> None:
        make_lined(store, TOUCHLINE)
        report = solve_fully(store, "demo", None, nobody, actor="ben")
        assert (report.total, report.solved) == (10, 10)
        state = read_policy(store, "demo")
        assert [item.actor for item in state.history] == ["ann", "ben"]
        assert state.policy.name == "touchline" and is_builtin_policy(state.policy)
        assert state.policy.click_sigma_px == pytest.approx(NOISY, rel=0.4)
        assert state.policy.calibration.line_sigma_px == pytest.approx(LINE_NOISY, rel=0.15)
        found = estimate_dataset_noise(store, "demo")
        assert (found.follows, found.values) == (True, {})
        solutions = [item.solution for item in read_states_of(store)]
        assert None not in solutions

    def test_solving_again_changes_nothing(self, store: Store) -> None:
        make_lined(store, TOUCHLINE)
        solve_fully(store, "demo", None, nobody)
        before = read_policy(store, "demo")
        assert solve_fully(store, "demo", None, nobody).total == 0
        # The shipped numbers again are the dataset's own, too.
        again = change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ben")
        assert read_policy(store, "demo") == before == again

    def test_an_edit_uses_what_is_stored(self, store: Store) -> None:
        make_lined(store, TOUCHLINE)
        solve_fully(store, "demo", None, nobody)
        before = read_policy(store, "demo")
        state = read_states_of(store)[0]
        ball = BallAnnotation(point=ImagePoint(5.0, 5.0))
        submit_edit(
            store, state.id, make_set_ball_edit("a", ball), if_match=state.etag, actor="ben"
        )
        assert not list_stale_groups(store, "demo")
        assert read_policy(store, "demo") == before

    def test_numbers_of_a_person_win(self, store: Store) -> None:
        make_lined(store, TOUCHLINE)
        mine = replace_thresholds(TOUCHLINE, {"click_sigma_px": 1.4}, name="mine")
        assert mine.noise == "fixed"
        change_policy(store, "demo", mine, if_match=None, actor="ben")
        solve_fully(store, "demo", None, nobody)
        assert read_policy(store, "demo").policy == mine
        assert replace_thresholds(TOUCHLINE, {"tau_percent": 0.9}, name="mine").noise == "estimated"

    def test_what_was_judged_by_an_earlier_touchline_keeps_its_numbers(self, store: Store) -> None:
        """Nothing moves by an upgrade: who wants the present one chooses it."""
        earlier = replace(TOUCHLINE, noise="fixed")
        make_lined(store, earlier)
        solve_fully(store, "demo", None, nobody)
        assert read_policy(store, "demo").policy == earlier and not is_builtin_policy(earlier)

    def test_somebodys_own_copies_keep_the_numbers_of_what_they_are_of(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        make_lined(store, TOUCHLINE)
        monkeypatch.setattr(noise, "is_copy_dataset", lambda *_: True)
        solve_fully(store, "demo", None, nobody)
        assert read_policy(store, "demo").policy == TOUCHLINE

    def test_a_group_that_cannot_be_solved_is_told_once(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        make_lined(store, TOUCHLINE)
        solve_fully(store, "demo", None, nobody)
        import_groups(
            store,
            "demo",
            [blurred("bad", np.random.default_rng(2), given=False)],
            source="more",
            actor="ann",
        )

        def fails(*_: object) -> None:
            raise ValueError("no")

        monkeypatch.setattr(recompute, "solve_and_encode", fails)
        report = solve_fully(store, "demo", None, nobody)
        assert (report.total, report.solved) == (1, 0)
        assert report.failed == [("bad", "ValueError: no")]

    def test_paper_stays_as_it_is(self, store: Store) -> None:
        make_lined(store)
        solve_fully(store, "demo", None, nobody)
        assert read_policy(store, "demo").policy == PAPER

    def test_of_many_groups_some_tell_and_the_others_are_solved_once(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(noise, "MAX_GROUPS", 4)
        make_lined(store, TOUCHLINE)
        told: list[tuple[object, ...]] = []
        report = solve_fully(store, "demo", None, lambda *said: told.append(said))
        assert (report.solved, report.failed) == (10, [])
        # Every third group first, then all under the policy that these made.
        assert {said[1] for said in told} == {4, 10}

    def test_estimates_that_stand_solve_the_rest_alone(self, store: Store) -> None:
        make_lined(store, TOUCHLINE)
        solve_fully(store, "demo", None, nobody)
        rng = np.random.default_rng(1)
        import_groups(store, "demo", [blurred("new", rng, given=False)], source="more", actor="ann")
        report = solve_fully(store, "demo", None, nobody)
        assert (report.total, report.solved) in {(1, 1), (11, 11)}
