from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import InputError
from app.http.cursor import paged, slice_page
from app.http.documents import ListDocument

Things = list[dict[str, int]]


def things(*ids: int) -> Things:
    return [{"id": number} for number in ids]


def walked(items: Things, limit: int) -> list[Things]:
    pages, cursor = [], None
    while True:
        page, cursor = slice_page(items, limit, cursor, "a" * 8)
        pages.append(page)
        if cursor is None:
            return pages


class TestPageOf:
    @given(st.integers(0, 30), st.integers(1, 12))
    def test_pages_are_the_whole_list_and_none_but_of_an_empty_one_is_empty(
        self, count: int, limit: int
    ) -> None:
        items = things(*range(count))
        pages = walked(items, limit)
        assert [item for page in pages for item in page] == items
        assert all(pages) or pages == [[]]
        assert all(len(page) == limit for page in pages[:-1])

    def test_without_a_limit_the_rest_is_one_page(self) -> None:
        _, cursor = slice_page(things(1, 2, 3), 1, None, "a" * 8)
        assert slice_page(things(1, 2, 3), None, cursor, "a" * 8) == (things(2, 3), None)

    def test_what_comes_before_the_page_is_not_seen_twice(self) -> None:
        _, cursor = slice_page(things(3, 2, 1), 2, None, "a" * 8)
        assert slice_page(things(5, 4, 3, 2, 1), 2, cursor, "a" * 8) == (things(1), None)

    def test_where_its_item_is_gone_the_next_one_is_not_missed(self) -> None:
        _, cursor = slice_page(things(1, 2, 3, 4), 2, None, "a" * 8)
        assert slice_page(things(1, 3, 4), 2, cursor, "a" * 8) == (things(3, 4), None)

    @pytest.mark.parametrize("cursor", ["", "7", "0.zz.a", "0." + "0" * 12 + "." + "b" * 8])
    def test_a_cursor_that_is_none_of_this_list_is_refused(self, cursor: str) -> None:
        with pytest.raises(InputError, match="not a cursor of this list"):
            slice_page(things(1, 2), 1, cursor, "a" * 8)


class TestPaged:
    def test_a_cursor_fits_the_list_that_gave_it_alone(self) -> None:
        @paged()
        def numbers(below: int) -> ListDocument[int]:
            return ListDocument[int](items=list(range(below)))

        first = numbers(below=4, limit=3, cursor=None)
        assert (first.items, numbers(below=4, limit=3, cursor=first.next).items) == ([0, 1, 2], [3])
        with pytest.raises(InputError, match="not a cursor of this list"):
            numbers(below=5, limit=3, cursor=first.next)
