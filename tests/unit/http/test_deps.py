"""Preconditions of a change."""

from __future__ import annotations

import asyncio
from inspect import iscoroutinefunction

import pytest

from app.errors import InputError
from app.http.deps import get_actor, get_services, get_store, require_if_match
from app.http.documents import get_keyed_request
from app.http.errors import PreconditionRequiredError


class TestRequireIfMatch:
    def test_a_strong_etag_is_taken_as_it_is(self) -> None:
        assert asyncio.run(require_if_match(' "9f2c-61d0" ')) == '"9f2c-61d0"'

    def test_a_change_without_if_match_is_refused(self) -> None:
        with pytest.raises(PreconditionRequiredError):
            asyncio.run(require_if_match(None))

    @pytest.mark.parametrize("tag", ["*", "", "abc", 'W/"a"', '"a", "b"', '"a', '"a"b"', '"ä"'])
    def test_a_weak_tag_a_list_or_a_star_is_refused(self, tag: str) -> None:
        with pytest.raises(InputError):
            asyncio.run(require_if_match(tag))


class TestDependencies:
    def test_those_of_every_request_are_coroutines_and_take_no_thread(self) -> None:
        for given in (get_services, get_store, get_actor, require_if_match, get_keyed_request):
            assert iscoroutinefunction(given), given.__name__
