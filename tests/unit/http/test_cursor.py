from __future__ import annotations

import pytest

from app.errors import InputError
from app.http.cursor import MAX_DIGITS, parse_cursor, parse_descending_cursor


class TestParseCursor:
    def test_without_a_cursor_the_list_begins_at_its_first_page(self) -> None:
        assert parse_cursor(None) is None

    def test_the_longest_number_that_the_database_takes_is_a_cursor(self) -> None:
        assert parse_cursor("9" * MAX_DIGITS) == 10**MAX_DIGITS - 1

    @pytest.mark.parametrize("cursor", ["", "x", "-1", "1.5", "٣", "9" * (MAX_DIGITS + 1)])
    def test_anything_else_is_refused_and_says_what_to_send(self, cursor: str) -> None:
        with pytest.raises(InputError, match="not a cursor of this list") as caught:
            parse_cursor(cursor)
        assert caught.value.pointer == "/cursor"
        assert "`next`" in str(caught.value.hint)


class TestFirstBelow:
    def test_the_cursor_counts_before_what_was_asked_in_its_place(self) -> None:
        assert [
            parse_descending_cursor("7", 9),
            parse_descending_cursor(None, 9),
            parse_descending_cursor(None, None),
        ] == [7, 9, None]
