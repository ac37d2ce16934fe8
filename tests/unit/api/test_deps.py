"""Preconditions of a change."""

from __future__ import annotations

import pytest

from app.api.deps import require_if_match
from app.api.errors import PreconditionRequiredError
from app.errors import InputError


class TestRequireIfMatch:
    def test_a_strong_etag_is_taken_as_it_is(self) -> None:
        assert require_if_match(' "9f2c-61d0" ') == '"9f2c-61d0"'

    def test_a_change_without_if_match_is_refused(self) -> None:
        with pytest.raises(PreconditionRequiredError):
            require_if_match(None)

    @pytest.mark.parametrize("tag", ["*", "", "abc", 'W/"a"', '"a", "b"', '"a', '"a"b"', '"ä"'])
    def test_a_weak_tag_a_list_or_a_star_is_refused(self, tag: str) -> None:
        with pytest.raises(InputError):
            require_if_match(tag)
