"""The ball of a view followed through the groups before and after: what comes of it, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import insert

from app.config import Settings
from app.db.store import Store
from app.errors import ConflictError, ImageError, InputError, NotFoundError
from app.features.groups.state import read_state
from app.features.independent_annotations.tables import GoldModel
from app.features.people.visibility_queries import READER, RestrictedReader
from app.features.recordings.follow import BallFollower
from app.features.tracks import follow
from app.features.tracks.follow import FollowedViews, follow_ball_from_view, plan_ball_following
from app.features.tracks.queries import find_dataset_match_and_key
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group
from tests.filmed_rigs import centers, filmed_groups
from tests.flights import FIRST

COUNT, CAMERA, CLICKED = 24, "cam1", FIRST + 10
Fill = Callable[..., list[int]]


@pytest.fixture
def frames(settings: Settings) -> Iterator[BallFollower]:
    found = BallFollower(settings)
    yield found
    found.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "film").mkdir()
    return tmp_path / "film"


def view_of(store: Store, group: int, camera: str = CAMERA) -> int:
    with store.read() as session:
        return read_state(session, group).view_ids[camera]


def off(found: FollowedViews) -> dict[int, float]:
    """How far each ball is off, pixels."""
    true = centers(COUNT, CAMERA)
    return {
        item.frame: float(np.hypot(*np.subtract(true[item.frame], (item.ball.x, item.ball.y))))
        for item in found.items
    }


class TestFollowView:
    def test_a_ball_goes_through_the_groups_before_and_after(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[CLICKED]))
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert (found.group, found.camera, found.frame) == (str(CLICKED), CAMERA, CLICKED)
        assert (found.before, found.after, found.sized) == ("end", "end", True)
        numbers = [number for number in range(FIRST, FIRST + COUNT) if number != CLICKED]
        assert [item.frame for item in found.items] == numbers
        assert [item.group for item in found.items] == [ids[n - FIRST] for n in numbers]
        assert max(off(found).values()) < 1.0
        assert {item.ball.state for item in found.items} == {"followed"}
        assert all(item.view == view_of(store, item.group) for item in found.items[:3])

    def test_frames_of_a_video_between_groups_are_looked_at(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        every = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED], video=True)
        ids = fill(*(group for group in every if int(group.key) % 5 == 0))
        found = follow_ball_from_view(store, frames, view_of(store, ids[2]))
        assert [item.frame - FIRST for item in found.items] == [0, 5, 15, 20]
        assert max(off(found).values()) < 1.0

    def test_files_between_groups_are_looked_at_and_missing_ones_passed(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        every = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED])
        ids = fill(*(group for group in every if int(group.key) % 5 == 0))
        for number in (FIRST + 7, FIRST + 12, FIRST + 13):
            (folder / CAMERA / f"{number:06d}.jpg").unlink()
        found = follow_ball_from_view(store, frames, view_of(store, ids[2]))
        assert [item.frame - FIRST for item in found.items] == [0, 5, 15, 20]
        assert max(off(found).values()) < 1.0

    def test_frames_that_cannot_be_read_are_passed_and_named(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[CLICKED]))
        for number in (FIRST + 7, FIRST + 12):
            (folder / CAMERA / f"{number:06d}.jpg").write_bytes(b"no picture")
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert found.unreadable == (FIRST + 7, FIRST + 12)
        states = {item.frame - FIRST: item.ball.state for item in found.items}
        assert states[7] == states[12] == "uncertain"
        assert (found.first, found.last) == (FIRST, FIRST + COUNT - 1)

    def test_it_ends_at_balls_that_are_there_and_leaves_them(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        said = [FIRST + 6, CLICKED, FIRST + 14]
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=said))
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert (found.before, found.after) == ("known", "known")
        assert [item.frame - FIRST for item in found.items] == [7, 8, 9, 11, 12, 13]

    def test_a_ball_that_somebody_said_is_out_of_view_ends_it(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED])
        gone = groups[13].view(CAMERA)
        assert gone is not None
        groups[13] = groups[13].with_view(replace(gone, balls=(BallAnnotation(out_of_view=True),)))
        ids = fill(*groups)
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert found.items[-1].frame == FIRST + 12
        assert (found.before, found.after) == ("end", "known")

    def test_an_inferred_ball_ends_it_and_is_no_place_where_the_ball_was_seen(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED, FIRST + 13])
        view = groups[13].view(CAMERA)
        assert view is not None and view.ball is not None
        groups[13] = groups[13].with_view(replace(view, balls=(replace(view.ball, inferred=True),)))
        ids = fill(*groups)
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert (found.items[-1].frame, found.after) == (FIRST + 12, "known")
        assert not plan_ball_following(store, view_of(store, ids[10])).sequence.clicks

    def test_a_view_that_is_left_out_gets_no_ball(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED])
        view = groups[12].view(CAMERA)
        assert view is not None
        groups[12] = groups[12].with_view(replace(view, included=False))
        ids = fill(*groups)
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]), each_way=3)
        assert [item.frame - CLICKED for item in found.items] == [-3, -2, -1, 1, 3]

    def test_groups_of_another_sequence_of_the_match_are_no_neighbours(
        self, store: Store, fill: Fill, folder: Path
    ) -> None:
        groups = filmed_groups(folder, 6, CAMERA, said=[FIRST])
        keyed = [
            replace(group, key=f"{'h1' if index < 3 else 'h2'}/{group.key}")
            for index, group in enumerate(groups)
        ]
        ids = fill(*keyed)
        assert len(plan_ball_following(store, view_of(store, ids[0])).states) == 3

    def test_the_most_groups_are_told_as_a_limit(
        self,
        store: Store,
        fill: Fill,
        frames: BallFollower,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(follow, "MOST_GROUPS", 4)
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[CLICKED]))
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert (found.before, found.after) == ("limit", "limit")

    def test_groups_that_are_hidden_from_whoever_asks_take_no_part(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[CLICKED, FIRST + 13]))
        view = view_of(store, ids[10])
        with store.write() as session:
            dataset = find_dataset_match_and_key(session, ids[13]).dataset_id
            gold = {"group_id": ids[13], "dataset_id": dataset, "start": "bare"}
            session.execute(
                insert(GoldModel), {**gold, "truth": b"", "marked": "x", "marked_by": "lea"}
            )
        blind = RestrictedReader("ann", {dataset: frozenset({1})}, lambda _: False)
        token = READER.set(blind)
        try:
            found = follow_ball_from_view(store, frames, view, each_way=5)
        finally:
            READER.reset(token)
        assert [item.frame - CLICKED for item in found.items] == [-5, -4, -3, -2, -1, 1, 2, 4, 5]
        assert found.after == "limit"
        assert follow_ball_from_view(store, frames, view, each_way=5).after == "known"

    def test_as_far_as_is_asked(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[CLICKED]))
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]), each_way=3)
        assert [item.frame - CLICKED for item in found.items] == [-3, -2, -1, 1, 2, 3]
        assert (found.before, found.after) == ("limit", "limit")

    def test_where_the_ball_is_gone_it_is_lost(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        hidden = range(FIRST + 18, FIRST + 60)
        groups = filmed_groups(folder, 60, CAMERA, said=[CLICKED], others=False, hidden=hidden)
        ids = fill(*groups)
        found = follow_ball_from_view(store, frames, view_of(store, ids[10]))
        assert found.after == "lost"
        assert {item.frame for item in found.items if item.ball.state == "followed"} <= set(
            range(FIRST, FIRST + 18)
        )

    def test_a_place_may_be_given_where_no_ball_is_annotated(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, COUNT, CAMERA, said=[]))
        view = view_of(store, ids[10])
        with pytest.raises(InputError, match="view cam1 has no ball"):
            follow_ball_from_view(store, frames, view)
        x, y = centers(COUNT, CAMERA)[CLICKED]
        found = follow_ball_from_view(store, frames, view, ImagePoint(x + 1.5, y - 1), 4)
        assert max(off(found).values()) < 1.0
        with pytest.raises(InputError, match="looks like a ball"):
            follow_ball_from_view(store, frames, view, ImagePoint(x + 200, y - 100), 4)


def broken(groups: Sequence[Group], **station: object) -> list[Group]:
    """The groups with another camera."""
    found = []
    for group in groups:
        view = group.view(CAMERA)
        assert view is not None
        other = replace(view.station, **station)  # type: ignore[arg-type]
        found.append(group.with_view(replace(view, station=other)))
    return found


class TestRefusals:
    def refused(self, store: Store, frames: BallFollower, group: int) -> str:
        with pytest.raises((InputError, NotFoundError, ImageError, ConflictError)) as error:
            follow_ball_from_view(store, frames, view_of(store, group))
        return error.value.message

    def test_of_a_camera_that_moves(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, 3, CAMERA, said=[FIRST])
        moving = [broken([g], key=f"{CAMERA}/{g.key}", shared=False)[0] for g in groups]
        assert "not a camera that stands still" in self.refused(store, frames, fill(*moving)[0])

    def test_of_groups_without_numbers(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, 3, CAMERA, said=[FIRST])
        named = [
            replace(group, key=f"goal {letter}x")
            for group, letter in zip(groups, "abc", strict=True)
        ]
        assert "does not end in a frame number" in self.refused(store, frames, fill(*named)[0])

    def test_of_one_group_alone(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        group = filmed_groups(folder, 1, CAMERA, said=[FIRST])[0]
        assert "no other group" in self.refused(store, frames, fill(group)[0])

    def test_of_groups_too_far_apart(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        every = filmed_groups(folder, COUNT, CAMERA, said=[CLICKED])
        kept = [group for group in every if int(group.key) in (FIRST, CLICKED, FIRST + 20)]
        for path in (folder / CAMERA).iterdir():
            if path.stem not in {f"{int(group.key):06d}" for group in kept}:
                path.unlink()
        ids = fill(*kept)
        with pytest.raises(
            InputError, match="nearest other frame of this camera is 10 frames away"
        ):
            follow_ball_from_view(store, frames, view_of(store, ids[1]))

    def test_without_a_frame(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        groups = filmed_groups(folder, 3, CAMERA, said=[FIRST])
        view = groups[0].view(CAMERA)
        assert view is not None
        groups[0] = groups[0].with_view(replace(view, media=None))
        assert "has no frame" in self.refused(store, frames, fill(*groups)[0])

    def test_where_its_frame_is_gone(
        self, store: Store, fill: Fill, frames: BallFollower, folder: Path
    ) -> None:
        ids = fill(*filmed_groups(folder, 3, CAMERA, said=[FIRST]))
        (folder / CAMERA / f"{FIRST:06d}.jpg").unlink()
        assert "is no longer in the place that it was imported from" in self.refused(
            store, frames, ids[0]
        )

    def test_of_an_independent_annotation(
        self,
        store: Store,
        fill: Fill,
        frames: BallFollower,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        ids = fill(*filmed_groups(folder, 3, CAMERA, said=[FIRST]))
        with store.read() as session:
            place = find_dataset_match_and_key(session, ids[0])
        assert place is not None
        monkeypatch.setattr(follow, "COPIES", place.dataset_id - 1)
        assert "no ball is followed" in self.refused(store, frames, ids[0])
