from __future__ import annotations

from app.features.groups.view_queries import (
    find_dataset_of_group,
    find_group_and_view_ids,
    find_view,
    list_dataset_views,
    list_group_views,
)
from app.features.queue.tables import QueueModel


class TestDatasetViews:
    def test_a_view_has_its_camera_its_frame_and_its_balls(self, filled, full_group) -> None:
        with filled.read() as session:
            found = list_dataset_views(session, 1)
        assert [(view.id, view.key, view.group) for view in found] == [
            (1, "7.png", "m/7.png"),
            (2, "cam1", "m/7.png"),
            (3, "cam2", "m/7.png"),
        ]
        for stored, view in zip(found, full_group.views, strict=True):
            assert (stored.width, stored.height) == (view.size.width, view.size.height)
            assert (stored.flipped, stored.media) == (view.station.flipped, view.media)
            assert tuple(stored.balls) == view.balls
            assert (stored.station, stored.shared) == (view.station.key, view.station.shared)
        assert {view.match for view in found} == {"m"}
        assert [view.station_id for view in found] == [2, 1, 1]

    def test_finds_only_the_views_that_are_asked_for(self, filled) -> None:
        with filled.read() as session:
            assert [view.id for view in list_dataset_views(session, 1, ids=[3, 9])] == [3]
            assert list_dataset_views(session, 1, [QueueModel.key == "m/8.png"]) == []
            assert list_dataset_views(session, 1, without_ball=True) == []
            assert list_dataset_views(session, 2) == []


class TestGroupViews:
    def test_views_come_in_the_order_of_their_group(self, filled) -> None:
        with filled.read() as session:
            assert [view.key for view in list_group_views(session, 1)] == ["7.png", "cam1", "cam2"]


class TestFindView:
    def test_finds_a_view_by_its_id(self, filled) -> None:
        with filled.read() as session:
            assert find_view(session, 2) == list_group_views(session, 1)[1]
            assert find_view(session, 9) is None


class TestGroupDataset:
    def test_of_a_group_that_is_there(self, filled) -> None:
        with filled.read() as session:
            assert (find_dataset_of_group(session, 1), find_dataset_of_group(session, 9)) == (
                1,
                None,
            )


class TestPresentIds:
    def test_ids_of_groups_and_views_by_their_keys(self, filled) -> None:
        with filled.read() as session:
            found = find_group_and_view_ids(session, 1, ["m/7.png", "m/8.png"])
        assert found == {"m/7.png": (1, {"7.png": 1, "cam1": 2, "cam2": 3})}
