from __future__ import annotations

import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.queue.statistics import read_timeline
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from tests.unit.features.queue.test_service_listing import fill_queue

FRAMES = (12, 10, 11, 40)


@pytest.fixture
def filmed(store: Store, make_static) -> Store:
    """Four frames of one match, imported out of order, and solved."""
    groups = [make_static(frame, (5.0, 2.0 + frame / 10, -0.5)) for frame in FRAMES]
    import_groups(store, "film", groups, source="test", actor="ann")
    solve_dataset(store, "film")
    return store


class TestReadTimeline:
    def test_every_column_has_one_value_a_group(self, filmed: Store) -> None:
        columns = vars(read_timeline(filmed, 1))
        assert {len(values) for values in columns.values()} == {len(FRAMES)}

    def test_groups_stand_in_the_order_of_their_numbers(self, filmed: Store) -> None:
        timeline = read_timeline(filmed, 1, "sort:error-desc")
        assert timeline.number == sorted(timeline.number)

    def test_frames_are_the_keys_as_numbers(self, filmed: Store) -> None:
        timeline = read_timeline(filmed, 1)
        keys = [load_group_state(filmed, group).group.key for group in timeline.id]
        assert [str(frame) for frame in timeline.frame] == keys

    def test_the_point_is_that_of_the_solution(self, filmed: Store) -> None:
        timeline = read_timeline(filmed, 1)
        for group, point, error in zip(timeline.id, timeline.point, timeline.error_px, strict=True):
            solution = load_group_state(filmed, group).solution
            assert solution is not None and solution.ball is not None
            assert point == pytest.approx(solution.ball.point, abs=1e-12)
            assert error is not None and error < 1.0
        assert timeline.passes == [True] * len(FRAMES)

    def test_a_query_and_a_match_narrow_it(self, filmed: Store) -> None:
        state = load_group_state(filmed, 2)
        # These frames have no pictures, so the note says what was looked at.
        note = "seen on video"
        set_verdict(filmed, 2, "accepted", note=note, if_match=state.etag, actor="ann")
        assert read_timeline(filmed, 1, "status:accepted").id == [2]
        assert read_timeline(filmed, 1, "", "issia").id == read_timeline(filmed, 1).id
        assert read_timeline(filmed, 1, "", "issi").id == []

    def test_a_query_that_cannot_be_understood_is_refused(self, filmed: Store) -> None:
        with pytest.raises(InputError):
            read_timeline(filmed, 1, "jac<many")

    def test_a_key_that_is_no_frame_number_and_a_missing_number_are_none(
        self, store: Store
    ) -> None:
        dataset = fill_queue(store, 40)
        timeline = read_timeline(store, dataset)
        assert timeline.frame == [None] * 40
        assert None in timeline.point
        assert {point[2] for point in timeline.point if point is not None} == {-0.1, -2.0}
