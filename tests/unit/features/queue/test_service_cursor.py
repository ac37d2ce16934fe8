from __future__ import annotations

import base64
import json

import pytest

from app.errors import InputError
from app.features.queue.query import Query, parse_query
from app.features.queue.service import decode_cursor, encode_cursor


def cursor(name: str, *keys: object) -> str:
    values = [f"{name} {parse_query('sort:jac').digest}", *keys]
    return base64.urlsafe_b64encode(json.dumps(values).encode()).decode().rstrip("=")


@pytest.fixture
def query() -> Query:
    return parse_query("sort:jac")


class TestDecode:
    def test_takes_the_keys_of_its_own_cursors(self, query: Query) -> None:
        assert decode_cursor(query, cursor("jac", 0.75, 3)) == [0.75, 3]

    def test_a_group_without_the_number_that_is_sorted_by_is_a_place_as_well(
        self, query: Query
    ) -> None:
        assert decode_cursor(query, cursor("jac", None, 3)) == [None, 3]

    @pytest.mark.parametrize(
        "key", [float("inf"), float("-inf"), float("nan"), 1e300, 2**64, [1], {"a": 1}]
    )
    def test_a_cursor_with_an_impossible_key_is_refused(self, query: Query, key: object) -> None:
        with pytest.raises(InputError, match="belongs to another query") as caught:
            decode_cursor(query, cursor("jac", key, 3))
        assert caught.value.pointer == "/cursor"

    @pytest.mark.parametrize(
        "other", ["sort:jac jac>0.5", "sort:jac status:accepted", "sort:sigma"]
    )
    def test_a_cursor_of_another_query_is_refused(self, query: Query, other: str) -> None:
        with pytest.raises(InputError, match="belongs to another query"):
            decode_cursor(parse_query(other), encode_cursor(query, [0.75, 3]))

    def test_white_space_between_terms_makes_no_other_query(self) -> None:
        given = encode_cursor(parse_query("jac>0.5  sort:jac"), [0.75, 3])
        assert decode_cursor(parse_query(" jac>0.5 sort:jac"), given) == [0.75, 3]
