from __future__ import annotations

import json
import math
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import DatasetFormatError
from app.formats.json_reader import MAX_DEPTH, MAX_NAMED, parse_literal, read_json, read_json_lines
from app.formats.report import ReaderReport

TEXT = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"))
PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | TEXT
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner),
    max_leaves=20,
)


class TestReadJson:
    def test_a_byte_order_mark_is_tolerated(self) -> None:
        assert read_json(b'\xef\xbb\xbf{"a": 1}', "f") == {"a": 1}

    @pytest.mark.parametrize("text", ["NaN", "[Infinity]", '{"a": -Infinity}', "1e999", "[-1e999]"])
    def test_numbers_that_are_not_finite_are_refused(self, text: str) -> None:
        with pytest.raises(DatasetFormatError, match="f: holds"):
            read_json(text.encode(), "f")

    @pytest.mark.parametrize(
        ("text", "value", "place"),
        [
            ('{"a": [{"b": NaN, "c": 1}]}', {"a": [{"b": None, "c": 1}]}, "f, a[0], b: is NaN"),
            ('{"a": {"7.png": {"x": [1, 1e999]}}}', {"a": {"7.png": {"x": [1, None]}}},
             "f, a.7.png, x[1]: is too large"),
            ('{"a": -Infinity}', {"a": None}, "f, a: is too large"),
            ("NaN", None, "f: is NaN"),
            (json.dumps('{"a": NaN}'), {"a": None}, "f, a: is NaN"),
            (f"[{'9' * 400}.5]", [None], "f, [0]: is too large"),
        ],
    )  # fmt: skip
    def test_with_a_report_one_bad_number_is_missing_and_the_rest_is_read(
        self, text: str, value: Any, place: str
    ) -> None:
        report = ReaderReport()
        assert read_json(text.encode(), "f", report=report, double_encoded=True) == value
        (remark,) = report.remarks
        assert remark.startswith(place)
        assert remark.endswith("read as missing")
        # Where it is of no use, it is left out by whoever reads the field.
        assert report.problems == []

    @pytest.mark.parametrize(
        "text",
        [
            r'{"a\u0000": ["b\u0000", "c\\u0000"]}',
            json.dumps(r'{"a\u0000": ["b\u0000", "c\\u0000"]}'),
            json.dumps(r"{'a\0': ['b\x00', 'c\\u0000']}"),
        ],
    )
    def test_u0000_which_no_database_holds_is_replaced_and_counted(self, text: str) -> None:
        report = ReaderReport()
        value = read_json(text.encode(), "f", report=report, double_encoded=True)
        assert value == {"a\ufffd": ["b\ufffd", "c\\u0000"]}
        assert report.remarks == [
            "f: holds 2 characters U+0000, which cannot be stored; read as U+FFFD"
        ]
        assert read_json(text.encode(), "f", double_encoded=True) == value

    def test_of_many_bad_numbers_the_first_are_named_and_the_rest_are_counted(self) -> None:
        report = ReaderReport()
        text = json.dumps({"annotations": [{"area": math.nan}] * 150})
        value = read_json(text.encode(), "f", report=report)
        assert value == {"annotations": [{"area": None}] * 150}
        assert len(report.remarks) == MAX_NAMED + 1
        assert report.remarks[-1] == (
            "f: 50 more numbers are not finite: area (50); read as missing"
        )

    def test_a_python_literal_with_nan_is_read_alike(self) -> None:
        report = ReaderReport()
        text = json.dumps("{'a': [nan, -inf, 1.5], 'b': 'nan'}").encode()
        value = read_json(text, "f", report=report, double_encoded=True)
        assert value == {"a": [None, None, 1.5], "b": "nan"}
        assert report.remarks == ["f: 2 numbers are not finite (nan, inf); read as missing"]
        for bad in ("{'a': nan, 'b': open('x')}", "[nan, x]", "[nan.real]", "-nan()"):
            with pytest.raises(DatasetFormatError, match="neither JSON nor"):
                read_json(json.dumps(bad).encode(), "f", report=report, double_encoded=True)

    def test_words_in_texts_are_no_numbers(self) -> None:
        report = ReaderReport()
        text = b'{"NaN": "Infinity", "a": 1e10, "b": 1.5e+20}'
        assert read_json(text, "f", report=report) == json.loads(text)
        assert report.problems == []

    def test_broken_text_names_its_line(self) -> None:
        with pytest.raises(DatasetFormatError, match="f, line 2, column 1: is not JSON"):
            read_json(b'{"a":\n', "f")

    def test_other_encodings_are_refused(self) -> None:
        with pytest.raises(DatasetFormatError, match="not UTF-8"):
            read_json('{"a": "ü"}'.encode("utf-16"), "f")

    def test_half_a_character_pair_is_refused_and_a_whole_one_read(self) -> None:
        assert read_json(b'"\\ud83d\\ude00"', "f") == "\U0001f600"
        with pytest.raises(DatasetFormatError, match="not UTF-8"):
            read_json(b'{"\\ud83d": 1}', "f")

    def test_deep_nesting_is_refused_before_it_is_parsed(self) -> None:
        with pytest.raises(DatasetFormatError, match="nested deeper"):
            read_json(b"[" * 1_000_000, "f")
        with pytest.raises(DatasetFormatError, match="nested deeper"):
            read_json(b'{"a":' * 200 + b"1" + b"}" * 200, "f")

    def test_brackets_in_strings_do_not_nest(self) -> None:
        text = json.dumps(["[" * 500, '\\"[[[' * 100] * 10)
        assert read_json(text.encode(), "f") == json.loads(text)

    def test_nesting_up_to_the_cap_is_read(self) -> None:
        text = b"[" * MAX_DEPTH + b"]" * MAX_DEPTH
        assert read_json(text + b" " * 10, "f") is not None

    @pytest.mark.parametrize("unit", [b'\\"', b'"', b"\\", b'"\\"', b'["'])
    def test_hostile_quotes_take_linear_time(self, unit: bytes) -> None:
        start = time.process_time()
        with pytest.raises(DatasetFormatError):
            read_json(b"[" * 65 + b'"' + unit * 500_000, "f")
        assert time.process_time() - start < 2

    def test_too_many_bytes_are_refused(self) -> None:
        with pytest.raises(DatasetFormatError, match="longer than 10 bytes"):
            read_json(b"[1, 2, 3, 4, 5]", "f", max_bytes=10)

    def test_a_huge_integer_is_refused(self) -> None:
        with pytest.raises(DatasetFormatError):
            read_json(b"1" * 10_000, "f")

    def test_a_json_string_that_holds_json_is_read_when_asked(self) -> None:
        text = json.dumps(json.dumps({"a": [1.5]}))
        assert read_json(text.encode(), "f", double_encoded=True) == {"a": [1.5]}
        assert read_json(text.encode(), "f") == '{"a": [1.5]}'

    def test_a_json_string_that_holds_a_python_literal_is_read_when_asked(self) -> None:
        value = {"a": (1.5, None), "b": {}}
        text = json.dumps(repr(value))
        assert read_json(text.encode(), "f", double_encoded=True) == value

    @given(PLAIN)
    def test_what_json_writes_is_read_the_same(self, value: Any) -> None:
        try:
            text = json.dumps(value, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            return
        assert read_json(text, "f") == value


class TestParseLiteral:
    @pytest.mark.parametrize(
        "text",
        ["__import__('os')", "open('f')", "{1, 2}", "b'a'", "1+2j", "[1, nan]", "array([1])",
         "lambda: 1", "a.b", "1e999", "(" * 300 + ")" * 300, "-" * 100_000 + "1", ""],
    )  # fmt: skip
    def test_nothing_but_plain_values_is_read(self, text: str) -> None:
        with pytest.raises(DatasetFormatError):
            parse_literal(text, "f", "row 3")

    def test_a_dict_of_python_values(self) -> None:
        assert parse_literal("{'a': [1, 2.5, None, True]}", "f") == {"a": [1, 2.5, None, True]}


class TestNan:
    @pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity", "1e999"])
    def test_is_kept_or_null_as_the_reader_wants(self, text: str) -> None:
        content = f'{{"a": {text}, "b": 1.5}}'.encode()
        report = ReaderReport()
        assert read_json(content, "f", report=report) == {"a": None, "b": 1.5}
        assert [remark.startswith("f, a: ") for remark in report.remarks] == [True]
        assert not math.isfinite(read_json(content, "f", nan="keep")["a"])

    def test_is_null_in_a_python_literal(self) -> None:
        content = json.dumps("{'a': nan, 'b': [-inf, 'nan'], \"it's nan\": 1}").encode()
        found = read_json(content, "f", double_encoded=True, nan="keep")
        assert found == {"a": None, "b": [None, "nan"], "it's nan": 1}


class TestReadJsonLines:
    def test_an_object_a_line(self) -> None:
        report = ReaderReport()
        assert read_json_lines(b'{"a": 1}\n\n{"a": 2}\n', "f", report) == [{"a": 1}, {"a": 2}]
        assert report.problems == []

    def test_a_bad_line_is_named(self) -> None:
        report = ReaderReport()
        assert read_json_lines(b'{"a": 1}\n{"a": \n', "f", report) == [{"a": 1}]
        assert (report.read, report.problems[0].record) == (1, "line 2")

    @pytest.mark.parametrize("text", ['{\n"a": [\n{}\n', "1\n2\n", '{"a": 1}', ""])
    def test_anything_else_is_none(self, text: str) -> None:
        report = ReaderReport()
        assert read_json_lines(text.encode(), "f", report) is None
        assert report.problems == []
