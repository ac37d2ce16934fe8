from __future__ import annotations

from typing import Any

import pytest

from app.formats.fields import IdIndex, id_to_text


class TestIdText:
    @pytest.mark.parametrize("value", [7, 7.0, "7", " 7 ", "7.0", "7."])
    def test_equal_numbers_have_one_text(self, value: Any) -> None:
        assert id_to_text(value) == "7"

    @pytest.mark.parametrize("value", [None, True, False, [], {}, "", "  ", 10**50])
    def test_what_is_no_id_has_none(self, value: Any) -> None:
        assert id_to_text(value) is None

    @pytest.mark.parametrize("value", ["007", "a7", "7.5", "-7"])
    def test_other_texts_stay(self, value: str) -> None:
        assert id_to_text(value) == value


class TestIdIndex:
    @pytest.mark.parametrize("listed", [1, 1.0, "1", "1.0", "001"])
    @pytest.mark.parametrize("asked", [1, 1.0, "1", "1.0", "01"])
    def test_a_record_is_found_however_its_id_is_spelt(self, listed: Any, asked: Any) -> None:
        index = IdIndex[str]()
        assert index.add(listed, "record")
        assert index.find(asked) == "record"

    def test_an_id_that_is_there_or_none_is_not_added(self) -> None:
        index = IdIndex[str]()
        assert index.add(1, "first")
        assert not index.add("1.0", "second")
        assert not index.add(None, "third")
        assert index.find(1) == "first"
        assert index.find(True) is None

    def test_texts_that_are_equal_as_numbers_are_two_records(self) -> None:
        index = IdIndex[str]()
        assert index.add("007", "spy")
        assert index.add("07", "other")
        assert (index.find("007"), index.find("07"), index.find(7)) == ("spy", "other", None)
