from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import InputError
from app.features.queue.fields import BY_NAME, COMPARED, FIELDS, QueryField
from app.features.queue.query import MAX_LENGTH, MAX_LISTED_LENGTH, NUMBERS, SORTS, parse_query


def pointer(text: str) -> str | None:
    with pytest.raises(InputError) as caught:
        parse_query(text)
    assert "\n" not in caught.value.message
    return caught.value.pointer


class TestParseQuery:
    def test_an_empty_query_lists_every_group_by_number(self) -> None:
        query = parse_query("  ")
        assert (query.conditions, query.sort, query.descending) == ((), "number", False)

    def test_the_example_of_the_manual(self) -> None:
        query = parse_query(
            "status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax split:train view:2 "
            'gate:reprojection match:"Alder Town" sort:value-desc'
        )
        assert len(query.conditions) == 8
        assert (query.sort, query.descending) == ("value", True)

    @pytest.mark.parametrize("name", SORTS)
    def test_every_sort_goes_both_ways(self, name: str) -> None:
        assert parse_query(f"sort:{name}").sort == name
        assert parse_query(f"sort:{name}-desc").descending

    @pytest.mark.parametrize("name", NUMBERS)
    @pytest.mark.parametrize("op", ["<", "<=", ">", ">=", "=", ":"])
    def test_every_number_compares(self, name: str, op: str) -> None:
        assert len(parse_query(f"{name}{op}1.5").conditions) == 1

    @pytest.mark.parametrize(
        ("text", "where"),
        [
            ("colour:red", "/q/0"),
            ("status:unreviewed jac<high", "/q/18"),
            ("status:maybe", "/q/0"),
            ("finding:ghosts", "/q/0"),
            ("gate:none,heaven", "/q/0"),
            ("split<train", "/q/0"),
            ("views:2 status:", "/q/8"),
            ("-jac<", "/q/0"),
            ("jac~0.9", "/q/0"),
            ("error!=2", "/q/0"),
            ("sigma≤0.5", "/q/0"),
            ("sort:colour", "/q/0"),
            ("jac<nan", "/q/0"),
            ("passes:maybe", "/q/0"),
            ("views:2 id:12,15x", "/q/8"),
            ("id:0", "/q/0"),
            ("id:12,,15", "/q/0"),
            ("id:-3", "/q/0"),
            ("id:٣", "/q/0"),
            (f"id:{2**63}", "/q/0"),
            ("id>12", "/q/0"),
            ('match:"open', "/q/0"),
            ("a " * 31, "/q/60"),
            ("x" * 1001, "/q"),
        ],
    )
    def test_a_query_that_cannot_be_understood_is_refused_with_its_place(
        self, text: str, where: str
    ) -> None:
        assert pointer(text) == where

    def test_unknown_fields_are_answered_with_the_known_ones(self) -> None:
        with pytest.raises(InputError) as caught:
            parse_query("colour:red")
        assert "sigma" in str(caught.value.hint)

    def test_a_bad_id_is_named_with_an_example(self) -> None:
        with pytest.raises(InputError, match='"15x" is not the id of a group') as caught:
            parse_query("id:12,15x")
        assert "id:12,15,19" in str(caught.value.hint)

    def test_what_is_no_number_is_answered_with_a_usual_one(self) -> None:
        with pytest.raises(InputError, match='"0,95" is not a number') as caught:
            parse_query("jac<0,95")
        hint = "For example jac<0.95, or jac:none. Numbers have a decimal point."
        assert caught.value.hint == hint

    @pytest.mark.parametrize("text", ["x-12", "view-7/2", "12:", "note:", '"jac~0.9"', "a~b"])
    def test_a_word_that_only_looks_like_a_field_stays_a_word(self, text: str) -> None:
        assert len(parse_query(text).conditions) == 1

    def test_a_list_of_groups_may_be_long_where_the_caller_says_so_and_nothing_else(self) -> None:
        listed = "id:" + ",".join(map(str, range(1, 15_001)))
        assert len(parse_query(listed, MAX_LISTED_LENGTH).conditions) == 1
        with pytest.raises(InputError, match=f"at most {MAX_LENGTH} characters"):
            parse_query(listed)
        with pytest.raises(InputError, match="only a list of ids") as caught:
            parse_query(f"views:2 {'x' * (MAX_LENGTH + 1)}", MAX_LISTED_LENGTH)
        assert caught.value.pointer == "/q/8"

    @given(st.text(max_size=80))
    def test_any_text_is_a_query_or_an_input_error(self, text: str) -> None:
        try:
            parse_query(text)
        except InputError as error:
            assert error.pointer is not None
            assert error.pointer.startswith("/q")


class TestFields:
    @pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
    def test_has_just_the_operators_that_its_table_says(self, field: QueryField) -> None:
        value = {"number": "1.5", "ids": "12"}.get(field.kind) or next(iter(field.values), "x")
        for name in (field.name, *field.also):
            for op in COMPARED:
                if op in field.operators:
                    parse_query(f"{name}{op}{value}")
                else:
                    with pytest.raises(InputError) as refused:
                        parse_query(f"jac<1 {name}{op}{value}")
                    assert (refused.value.pointer, "it has : and =" in refused.value.message) == (
                        "/q/6",
                        True,
                    )

    @pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
    def test_takes_every_value_of_its_table(self, field: QueryField) -> None:
        # An order is no condition: every group is in it.
        conditions = 0 if field.name == "sort" else 1
        either = [",".join(field.values)] if field.several and len(field.values) > 1 else []
        for value in [*field.values, *either]:
            assert len(parse_query(f"{field.name}:{value}").conditions) == conditions, value

    @pytest.mark.parametrize(
        "text", ["status<accepted", "passes>yes", "match>=a", "id<12", "sort<x"]
    )
    def test_only_numbers_have_an_order(self, text: str) -> None:
        assert pointer(text) == "/q/0"

    def test_one_that_there_is_not_is_answered_with_the_nearest(self) -> None:
        with pytest.raises(InputError, match="did you mean sigma"):
            parse_query("sigmaa<0.1")

    def test_a_minus_before_an_order_is_refused(self) -> None:
        assert pointer("-sort:value") == "/q/0"

    def test_columns_and_queries_speak_of_the_same_by_both_names(self) -> None:
        for row, asked in (("min_jac", "jac"), ("error_px", "error"), ("first_failing", "gate")):
            assert BY_NAME[row] is BY_NAME[asked]
