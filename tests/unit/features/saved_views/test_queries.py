from __future__ import annotations

from app.features.saved_views.queries import (
    delete_saved_view,
    find_saved_view,
    insert_saved_view,
    list_saved_views_of_dataset,
)


class TestSavedViews:
    def test_come_by_name_until_they_are_deleted(self, filled) -> None:
        with filled.write() as session:
            late = insert_saved_view(session, 1, name="late", query="sort:newest", actor="ann")
            early = insert_saved_view(session, 1, name="early", query="views:2", actor="bob")
            assert [row.id for row in list_saved_views_of_dataset(session, 1)] == [early, late]
            assert list_saved_views_of_dataset(session, 2) == []
            found = find_saved_view(session, late)
            assert (found.dataset_id, found.name, found.query) == (1, "late", "sort:newest")
            delete_saved_view(session, late)
            assert find_saved_view(session, late) is None
            assert [row.name for row in list_saved_views_of_dataset(session, 1)] == ["early"]
