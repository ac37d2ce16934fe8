"""The noise of a dataset, and the policy that takes it over."""

from __future__ import annotations

import numpy as np
import pytest

from app.errors import DegenerateGeometryError, InputError, NotFoundError
from app.review.editing.recompute import solve_dataset, stale_groups
from app.review.importing.ingest import ensure_dataset, ingest
from app.review.policies import noise
from app.review.policies.noise import apply_noise, read_noise
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.solving.ball_noise import Miss
from app.solving.spread import CLICK_DIAGONAL
from app.store.session import Store
from tests.cameras import SIZE
from tests.unit.review.conftest import BEHIND, MAIN, OPPOSITE, drawn

UNIT = SIZE.diagonal / CLICK_DIAGONAL
NOISY = 3.0


def blurred(key: str, rng: np.random.Generator, *, given: bool) -> Group:
    """A ball somewhere, clicked with noise in three views of known cameras."""
    place = np.array([[rng.uniform(0, 10), rng.uniform(-5, 5), -1.0]])
    views = []
    for name, camera in (("a", MAIN), ("b", BEHIND), ("c", OPPOSITE)):
        x, y = camera.project(place)[0] + rng.normal(0, NOISY * UNIT, 2)
        lines = {} if given else drawn(camera)
        known = camera if given else None
        station = Station(name, SIZE, shared=True, lines=lines, given=known)
        views.append(View(name, station, (BallAnnotation(point=ImagePoint(x, y)),)))
    return Group(key, tuple(views))


def make(store: Store, *, given: bool) -> None:
    rng = np.random.default_rng(1)
    groups = [blurred(str(n), rng, given=given) for n in range(25)]
    ingest(store, "demo", groups, source="test", actor="ann")
    solve_dataset(store, "demo")


class TestReadNoise:
    def test_clicks_noisier_than_the_policy_thinks_are_noticed(self, store: Store) -> None:
        make(store, given=False)
        found = read_noise(store, "demo")
        (advice,) = found.advice
        assert (advice.name, advice.present, advice.agrees) == ("click_sigma_px", 1.0, False)
        assert advice.low < NOISY < advice.high
        assert "too small" in found.notices[0]
        assert (found.groups, found.solved) == (25, 25)
        assert found.lines is not None and found.lines.views == 3

    def test_of_given_cameras_it_is_theirs(self, store: Store) -> None:
        make(store, given=True)
        found = read_noise(store, "demo")
        assert [item.name for item in found.advice] == ["given_sigma_px"]
        assert found.lines is None

    def test_an_empty_dataset_says_that_nothing_is_known(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        found = read_noise(store, "demo")
        assert (found.advice, found.values, len(found.notices)) == ((), {}, 1)
        with pytest.raises(NotFoundError):
            read_noise(store, "nothing")

    @pytest.mark.parametrize("error", [np.linalg.LinAlgError, DegenerateGeometryError])
    def test_lines_that_leave_a_camera_open_are_passed_over(
        self, store: Store, monkeypatch: pytest.MonkeyPatch, error: type[Exception]
    ) -> None:
        make(store, given=False)

        def fails(*_: object) -> None:
            raise error("open")

        monkeypatch.setattr(noise, "view_line_noise", fails)
        found = read_noise(store, "demo")
        assert (found.lines, len(found.advice)) == (None, 1)

    def test_what_is_put_into_the_policy_is_what_was_shown(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        make(store, given=False)
        rng = np.random.default_rng(2)
        misses = [
            Miss(rng.normal(0, np.hypot(0.5, 0.08 * size)), 1.0, size**2, 0.0, 0.0)
            for size in rng.uniform(5, 40, 600)
        ]
        shown = iter([misses])
        monkeypatch.setattr(noise, "_misses", lambda _: next(shown, ()))
        found = read_noise(store, "demo")
        click, share = found.advice
        assert (click.name, share.name, share.unit) == (
            "click_sigma_px",
            "box_sigma_share",
            "share",
        )
        assert share.low < 0.08 < share.high and share.present == 0.04 and not share.agrees
        assert found.values == {item.name: item.estimate for item in found.advice}
        assert not any("0.08 px" in sentence for sentence in found.notices)


class TestApplyNoise:
    @pytest.mark.parametrize("given", [False, True], ids=["lines", "given"])
    def test_the_policy_takes_it_over_and_agrees_from_then_on(
        self, store: Store, given: bool
    ) -> None:
        make(store, given=given)
        found = read_noise(store, "demo")
        state = apply_noise(store, found, actor="ben")
        assert (state.policy.name, state.history[-1].actor) == ("custom", "ben")
        name = found.advice[0].name
        assert getattr(state.policy, name) == found.advice[0].estimate
        assert len(stale_groups(store, state.dataset_id)) == 25
        solve_dataset(store, "demo")
        again = read_noise(store, "demo")
        assert all(item.agrees for item in again.advice)
        assert (again.values, again.notices) == ({}, ())
        with pytest.raises(InputError, match="need not change"):
            apply_noise(store, again, actor="ben")
