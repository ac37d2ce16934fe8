"""Gold groups in a film by static cameras: mixed into a batch of its frames, and measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.db.store import Store
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.service import NewBatch, get_batch, make_batch
from app.features.datasets.service import get_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.independent_annotations.gold import mark_gold_group, read_gold_report
from app.features.independent_annotations.service import get_annotation_of_copy
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Media
from tests.e2e.film import write_film

FIRST, GOLD = 100, 110
"""Frames of the batch's first group and of the gold one."""
ANN = BatchMember("ann", may_review=False)


@pytest.fixture
def film(store: Store, tmp_path: Path) -> dict[int, int]:
    """Groups by frame: four instants of six cameras' videos, solved; a lead has judged one."""
    read = open_issia(write_film(tmp_path / "film"), IssiaOptions(), ReaderReport())
    groups = []
    for group in read.groups():
        frame = int(group.key)
        if frame in (GOLD, *range(FIRST, FIRST + 3)):
            views = tuple(
                replace(view, media=Media(f"{view.key}.mp4", frame=frame)) for view in group.views
            )
            groups.append(replace(group, views=views))
    import_groups(store, "film", groups, source="issia", actor="local")
    solve_dataset(store, "film")
    dataset = get_dataset(store, "film").id
    rows = list_groups(store, dataset, limit=9).items
    found = {int(load_group_state(store, row.id).group.key): row.id for row in rows}
    etag = load_group_state(store, found[GOLD]).etag
    set_verdict(store, found[GOLD], "accepted", None, "seen", if_match=etag, actor="lea")
    invite(store, "ann", Role.ANNOTATOR, actor="local")
    return found


def annotate(store: Store, copy: int, dx: float, dy: float) -> None:
    """Move the ball of a copy's first camera, in pixels; where it has none it is drawn where it was."""
    state = load_group_state(store, copy)
    view = state.group.views[0]
    at = view.balls[0].center
    ball = BallAnnotation(point=ImagePoint(at.x + dx, at.y + dy))
    submit_edit(store, copy, make_set_ball_edit(view.key, ball), if_match=state.etag, actor="ann")


class TestGoldInAFilm:
    def test_it_is_mixed_in_looks_like_any_frame_and_its_error_is_shown(
        self, store: Store, film: dict[int, int]
    ) -> None:
        mark_gold_group(store, film[GOLD], "imported", actor="lea")
        frames = ",".join(str(film[FIRST + n]) for n in range(3))
        new = NewBatch("film", f"id:{frames}", annotators=["ann"], gold_every=2)
        batch = make_batch(store, "film", new, actor="lea").id
        leases, kinds, shapes = LeaseService(store), [], set()
        while (copy := leases.lease_next_group(batch, ANN).group) is not None:
            take, state = get_annotation_of_copy(store, copy), load_group_state(store, copy)
            kinds.append(take.kind)
            assert all(view.media is not None for view in state.group.views)
            shapes.add(
                (
                    state.group.match,
                    tuple(view.key for view in state.group.views),
                    tuple(view.station.key for view in state.group.views),
                    tuple(entry.kind for entry in read_history(store, copy)),
                )
            )
            assert state.solution is not None and state.solution.ball is not None
            annotate(store, copy, 3.0, 4.0)
            leases.submit_group(batch, copy, ANN, actor="ann")
        assert (kinds.count("gold"), kinds.count("independent")) == (1, 3)
        assert len(shapes) == 1
        assert get_batch(store, batch).submitted == 3
        (person,) = read_gold_report(store, "film").people
        (result,) = person.results
        assert (person.person, result.group) == ("ann", film[GOLD])
        assert result.error.ball_px == pytest.approx(5.0)
        assert (result.error.line_px, result.error.lines_missing) == (0.0, 0)
        assert result.error.ball_m is not None and 0.0 < result.error.ball_m < 0.5

    @pytest.mark.parametrize("start", ["without_balls", "bare"])
    def test_its_annotator_begins_without_the_ball_and_has_the_cameras(
        self, store: Store, film: dict[int, int], start: str
    ) -> None:
        mark_gold_group(store, film[GOLD], start, actor="lea")
        new = NewBatch("film", f"id:{film[FIRST]}", annotators=["ann"], gold_every=1)
        batch = make_batch(store, "film", new, actor="lea").id
        copy = LeaseService(store).lease_next_group(batch, ANN).group
        assert get_annotation_of_copy(store, copy).kind == "gold"
        views = load_group_state(store, copy).group.views
        assert [view.balls for view in views] == [()] * 6
        # Static cameras are everybody's: their lines are not those of this picture.
        assert all(view.station.lines for view in views)
        LeaseService(store).submit_group(batch, copy, ANN, actor="ann")
        ((result,),) = [one.results for one in read_gold_report(store, "film").people]
        assert (result.error.ball_px, result.error.balls_missing) == (None, 6)
