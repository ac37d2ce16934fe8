"""How noisy balls are: given to the views of a dataset, brought by who places one, taken back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.log import read_log
from app.db.store import Store
from app.features.groups import group_edits
from app.features.groups.edit import CompositeEdit, SetBalls, make_set_ball_edit
from app.features.groups.group_edits import (
    add_noise_of_actor,
    apply_noise_factors,
    read_last_ball_actors,
)
from app.features.groups.history import read_history
from app.features.groups.submit import (
    load_group_state,
    solve_and_store_group,
    solve_edited_group,
    submit_edit,
    submit_edits,
)
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.imports.edits_export import group_to_export_json
from app.features.imports.ingest import import_groups
from app.features.match_estimates.queries import (
    NOISE,
    NoiseFactor,
    find_noise_factor,
    noise_factors_to_json,
    read_noise_factors,
)
from app.features.queue.service import list_groups
from app.features.solutions.service import list_stale_groups
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
OTHER = BallAnnotation(box=Box(510.0, 300.0, 14.0, 14.0))
FACTORS = (
    NoiseFactor(None, None, 1.0),
    NoiseFactor(None, "ann", 1.5),
    NoiseFactor("cam2", None, 2.0),
    NoiseFactor("cam2", "ann", 4.0),
)


def give(store: Store, *factors: NoiseFactor) -> int:
    with store.write() as session:
        return apply_noise_factors(session, 1, factors, "lea")


def place(store: Store, group: int, actor: str, ball: BallAnnotation = BALL) -> str:
    """Place the ball of the last view; returns the view's key."""
    state = load_group_state(store, group)
    key = state.group.views[-1].key
    submit_edit(store, group, make_set_ball_edit(key, ball), if_match=state.etag, actor=actor)
    return key


def noise(store: Store, group: int) -> dict[str, float]:
    return load_group_state(store, group).group.noise_factors_by_view


@pytest.fixture
def static(store: Store, fill, make_static) -> int:
    """A solved group of static cameras, its balls as the dataset brought them."""
    (group,) = fill(make_static(10))
    solve_and_store_group(store, group)
    return group


class TestGiveFactors:
    def test_balls_have_the_noise_of_their_camera_and_of_who_placed_them(
        self, store: Store, static: int
    ) -> None:
        before = load_group_state(store, static)
        keys = [view.key for view in before.group.views if view.station.key == "cam2"]
        assert give(store, *FACTORS) == 1
        assert noise(store, static) == dict.fromkeys(keys, 2.0)
        assert list_stale_groups(store, 1) and load_group_state(store, static).etag != before.etag
        after = solve_and_store_group(store, static).solution
        assert after is not None and after.ball is not None and before.solution is not None
        assert after.ball.point == before.solution.ball.point
        assert after.ball.sigma_m > before.solution.ball.sigma_m
        assert after.best_ball != before.solution.best_ball

    def test_taken_back_all_is_as_it_was(self, store: Store, static: int) -> None:
        before = load_group_state(store, static)
        give(store, *FACTORS)
        assert give(store) == 1
        after = load_group_state(store, static)
        assert after.group == before.group and after.solution == before.solution
        with store.read() as session:
            assert read_noise_factors(session, 1) == ()
            assert [entry.kind for entry in read_history(store, static)] == [
                "import",
                "noise",
                "noise",
            ]

    def test_the_dataset_brought_again_leaves_it(
        self, store: Store, static: int, make_static
    ) -> None:
        give(store, *FACTORS)
        group = make_static(10)
        views = tuple(replace(view, media=None) for view in group.views)
        import_groups(
            store, "demo", [replace(group, views=views, label="again")], source="b", actor="ann"
        )
        assert load_group_state(store, static).group.label == "again"
        assert set(noise(store, static).values()) == {2.0}
        assert "noise" not in str(
            group_to_export_json(load_group_state(store, static).group)["views"]
        )

    def test_who_placed_a_ball_last_counts_and_a_prediction_is_nobodys(
        self, store: Store, static: int
    ) -> None:
        place(store, static, "eve", OTHER)
        key = place(store, static, "ann")
        give(store, *FACTORS)
        camera = load_group_state(store, static).group.view(key)
        assert camera is not None
        assert noise(store, static)[key] == find_noise_factor(FACTORS, camera.station.key, "ann")
        place(store, static, "ann", replace(BALL, predicted_by="yolo"))
        with store.read() as session:
            assert read_last_ball_actors(session, [static]) == {static: {}}
        give(store, NoiseFactor(None, None, 3.0))
        assert key not in noise(store, static)
        assert set(noise(store, static).values()) == {3.0}

    def test_all_groups_get_theirs_and_those_that_have_it_are_left_alone(
        self, store: Store, fill, make_static, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(group_edits, "_BATCH", 1)
        groups = fill(*(make_static(frame) for frame in (10, 11)))
        for group in groups:
            etag = load_group_state(store, group).etag
            set_verdict(store, group, "accepted", None, "by the lines", if_match=etag, actor="ann")
        assert give(store, *FACTORS) == 2
        assert [row.stale for row in list_groups(store, 1, limit=2).items] == [True, True]
        assert give(store, *FACTORS) == 0
        kinds = [[entry.kind for entry in read_history(store, group)] for group in groups]
        assert kinds == [["import", "verdict", "noise"]] * 2

    def test_the_log_holds_what_was_before(self, store: Store, static: int) -> None:
        give(store, *FACTORS)
        given = noise(store, static)
        give(store)
        with store.read() as session:
            entries = [entry for entry in read_log(session) if entry.kind == NOISE]
        whole, own = (
            [entry for entry in entries if (entry.group_id is None) == is_whole][-1]
            for is_whole in (True, False)
        )
        assert whole.body == {"factors": [], "before": noise_factors_to_json(FACTORS)}
        assert set(own.body["edit"]["noise"].values()) == {1.0}
        assert own.body["inverse"]["noise"] == given
        assert (whole.actor, own.actor) == ("lea", "lea")


class TestWithNoise:
    def test_every_ball_that_an_edit_places_brings_the_noise_of_its_camera_and_person(
        self, make_static
    ) -> None:
        group = make_static(10)
        one, two = make_set_ball_edit("cam2", BALL), SetBalls("cam1", (BALL,))
        assert add_noise_of_actor(FACTORS, group, one, "ann") == replace(one, noise=4.0)
        assert add_noise_of_actor(
            FACTORS, group, CompositeEdit((one, two)), "ann"
        ) == CompositeEdit((replace(one, noise=4.0), replace(two, noise=1.5)))
        moving = group.view("cam2")
        assert moving is not None
        alone = group.with_view(replace(moving, station=replace(moving.station, shared=False)))
        assert add_noise_of_actor(FACTORS, alone, one, "ann") == replace(one, noise=1.5)

    def test_an_edit_that_places_none_and_a_dataset_without_noise_stay_as_they_are(
        self, make_static
    ) -> None:
        group, none = make_static(10), make_set_ball_edit("cam2", None)
        assert add_noise_of_actor(FACTORS, group, none, "ann") is none
        placed = SetBalls("cam2", (BALL,), 2.0)
        assert add_noise_of_actor((), group, placed, "ann") is placed

    def test_who_places_a_ball_later_brings_theirs_and_undo_takes_it_along(
        self, store: Store, static: int
    ) -> None:
        give(store, *FACTORS)
        given = noise(store, static)
        key = place(store, static, "ann")
        own = load_group_state(store, static).group.view(key)
        assert own is not None
        wanted = find_noise_factor(FACTORS, own.station.key, "ann")
        assert own.noise == wanted != given.get(key, 1.0)
        undo_group_edit(store, static, if_match=load_group_state(store, static).etag, actor="ann")
        assert noise(store, static) == given

    def test_undo_and_redo_bring_balls_back_with_the_noise_that_is_accepted_by_now(
        self, store: Store, static: int
    ) -> None:
        give(store, *FACTORS)
        key = place(store, static, "eve", OTHER)
        assert place(store, static, "ann") == key
        give(store, NoiseFactor(None, None, 1.25), NoiseFactor(None, "ann", 3.0))
        assert noise(store, static)[key] == 3.0
        for step, expected in (
            (undo_group_edit, 1.25),
            (redo_group_edit, 3.0),
            (undo_group_edit, 1.25),
            (undo_group_edit, 1.25),
            (redo_group_edit, 1.25),
        ):
            # Whoever takes back has not placed the ball.
            step(store, static, if_match=load_group_state(store, static).etag, actor="ann")
            assert noise(store, static)[key] == expected
        give(store)
        step(store, static, if_match=load_group_state(store, static).etag, actor="ann")
        assert noise(store, static) == {}

    def test_a_prediction_that_somebody_accepts_is_not_theirs(
        self, store: Store, static: int
    ) -> None:
        give(store, *FACTORS)
        key = place(store, static, "ann", replace(BALL, predicted_by="yolo"))
        assert key not in noise(store, static)
        with store.read() as session:
            assert read_last_ball_actors(session, [static]) == {static: {}}

    def test_a_preview_keeps_what_the_view_has(self, store: Store, static: int) -> None:
        give(store, *FACTORS)
        key = next(iter(noise(store, static)))
        group, _ = solve_edited_group(store, static, lambda _group: [make_set_ball_edit(key, BALL)])
        assert group.noise_factors_by_view[key] == 2.0


class TestFactorOf:
    def test_cameras_and_people_that_are_not_named_are_any_other(self) -> None:
        asked = [("cam2", "ann"), ("cam2", "eve"), ("cam9", "ann"), ("cam9", None), (None, None)]
        assert [find_noise_factor(FACTORS, *at) for at in asked] == [4.0, 2.0, 1.5, 1.0, 1.0]
        assert find_noise_factor((), "cam2", "ann") == 1.0


class TestReadPlaced:
    def test_undo_and_redo_give_a_ball_back_to_who_placed_it(
        self, store: Store, static: int
    ) -> None:
        key = place(store, static, "eve", OTHER)
        place(store, static, "ann")
        for step, person in (
            (undo_group_edit, "eve"),
            (undo_group_edit, None),
            (redo_group_edit, "eve"),
            (redo_group_edit, "ann"),
        ):
            step(store, static, if_match=load_group_state(store, static).etag, actor="lea")
            with store.read() as session:
                found = read_last_ball_actors(session, [static])[static]
            assert found == ({} if person is None else {key: person})

    def test_knows_who_placed_balls_of_several_views_in_one_edit(
        self, store: Store, static: int
    ) -> None:
        state = load_group_state(store, static)
        keys = [view.key for view in state.group.views[:2]]
        edits = [make_set_ball_edit(key, BALL) for key in keys]
        submit_edits(store, static, edits, if_match=state.etag, actor="ann")
        with store.read() as session:
            assert read_last_ball_actors(session, [static]) == {static: dict.fromkeys(keys, "ann")}
