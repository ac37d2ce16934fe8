from __future__ import annotations

import pytest
from sqlalchemy import update

from app.errors import ConflictError, InputError, NotFoundError
from app.features.saved_views import service as saved_views
from app.features.saved_views.queries import SavedViewModel
from app.features.saved_views.service import (
    list_saved_views,
    read_saved_view,
    remove_saved_view,
    save_view,
)


@pytest.fixture
def ids(fill, make_group) -> list[int]:
    return fill(make_group(7), make_group(8, split="test"))


class TestSaveView:
    def test_is_listed_by_name_with_what_matches_now(self, store, ids) -> None:
        save_view(store, 1, name=" Of the test ", q="split:test ", actor="ann")
        save_view(store, 1, name="All", q="", actor="ben")
        found = list_saved_views(store, 1)
        assert [(item.name, item.q, item.by, item.groups) for item in found] == [
            ("All", "", "ben", 2),
            ("Of the test", "split:test", "ann", 1),
        ]
        assert list_saved_views(store, 2) == []

    def test_a_name_is_taken_once(self, store, ids) -> None:
        save_view(store, 1, name="All", q="", actor="ann")
        with pytest.raises(ConflictError, match='"All"'):
            save_view(store, 1, name="All", q="split:test", actor="ben")
        assert read_saved_view(store, 1).q == ""

    @pytest.mark.parametrize("name", ["", "  ", "x" * 81, "a\nb"])
    def test_a_name_can_be_read(self, store, ids, name: str) -> None:
        with pytest.raises(InputError) as caught:
            save_view(store, 1, name=name, q="", actor="ann")
        assert caught.value.pointer == "/name"

    def test_a_query_that_cannot_be_understood_is_refused(self, store, ids) -> None:
        with pytest.raises(InputError):
            save_view(store, 1, name="Red ones", q="colour:red", actor="ann")

    def test_there_is_an_end_to_them(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(saved_views, "MAX_VIEWS", 1)
        save_view(store, 1, name="All", q="", actor="ann")
        with pytest.raises(ConflictError, match="at most 1"):
            save_view(store, 1, name="More", q="", actor="ann")

    def test_one_person_has_an_end_before_the_others(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(saved_views, "MAX_OWN", 2)
        for name, actor in (("One", "ann"), ("Two", "ann (token nightly)")):
            save_view(store, 1, name=name, q="", actor=actor)
        with pytest.raises(ConflictError, match="one person has at most 2"):
            save_view(store, 1, name="Three", q="", actor="ann")
        assert save_view(store, 1, name="Three", q="", actor="ben").name == "Three"

    def test_who_works_alone_has_all_the_room(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(saved_views, "MAX_OWN", 0)
        assert save_view(store, 1, name="One", q="", actor="local").name == "One"


class TestListSavedViews:
    def test_a_query_of_another_version_finds_nothing_and_spoils_no_list(self, store, ids) -> None:
        old = save_view(store, 1, name="Old", q="", actor="ann")
        save_view(store, 1, name="Present", q="", actor="ann")
        with store.write() as session:
            changed = update(SavedViewModel).where(SavedViewModel.id == old.id)
            session.execute(changed.values(query="colour:red"))
        found = [(item.name, item.q, item.groups) for item in list_saved_views(store, 1)]
        assert found == [("Old", "colour:red", 0), ("Present", "", 2)]


class TestDeleteView:
    def test_answers_what_it_was(self, store, ids) -> None:
        saved = save_view(store, 1, name="All", q="sort:sigma", actor="ann")
        assert remove_saved_view(store, saved.id) == saved
        assert list_saved_views(store, 1) == []
        with pytest.raises(NotFoundError):
            remove_saved_view(store, saved.id)
