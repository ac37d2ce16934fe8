from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import DatasetFormatError
from app.formats.csv_text import (
    CsvTableWriter,
    format_csv_cell,
    format_number_list,
    is_missing,
    parse_number_list,
    read_rows,
)
from app.formats.file_tree import DEFAULT_LIMITS, ImportLimits


class TestCell:
    @pytest.mark.parametrize(
        ("value", "text"),
        [
            (None, ""),
            (float("nan"), ""),
            (True, "True"),
            (7, "7"),
            (0.1, "0.1"),
            (-2.5e-17, "-2.5e-17"),
            (np.float64(0.1), "0.1"),
            ("[1.0, 2.0]", "[1.0, 2.0]"),
        ],
    )
    def test_numbers_by_repr_and_nothing_for_what_is_missing(self, value: Any, text: str) -> None:
        assert format_csv_cell(value) == text

    @pytest.mark.parametrize(
        "text", ["=1+2", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "=HYPERLINK()"]
    )
    def test_a_formula_is_escaped(self, text: str) -> None:
        assert format_csv_cell(text) == f"'{text}"

    @pytest.mark.parametrize("text", ["-5", "+1.5", "-1e-7", "-.5"])
    def test_the_text_of_a_number_is_untouched(self, text: str) -> None:
        assert format_csv_cell(text) == text


class TestPlainList:
    def test_every_digit_and_no_numpy(self) -> None:
        assert format_number_list([np.float64(0.1), 2.0]) == "[0.1, 2.0]"
        assert format_number_list([3, 4]) == "[3, 4]"


class TestTable:
    def test_the_index_column_comes_first_and_has_no_name(self) -> None:
        file = io.StringIO()
        table = CsvTableWriter(file, ["a", "b"])
        table.add([1.5, None])
        table.add(["x,y", False])
        assert file.getvalue() == ',a,b\n0,1.5,\n1,"x,y",False\n'
        assert table.rows == 2


class TestReadRows:
    def test_rows_by_column_with_their_lines(self) -> None:
        content = '\ufeff,a,b\n0,"x\ny",\'=1+a\n\n1,2\n'.encode()
        rows = list(read_rows(content, "f", ("a",), DEFAULT_LIMITS))
        assert rows == [(3, {"": "0", "a": "x\ny", "b": "=1+a"}), (5, {"": "1", "a": "2"})]

    @pytest.mark.parametrize(
        ("content", "problem"),
        [
            (b"b\n1\n", "is missing from the columns"),
            (b"a\n\xff\n", "is not UTF-8"),
            (b'a\n"x', "is not valid CSV"),
            (b"", "is missing from the columns"),
        ],
    )
    def test_what_is_no_such_table_is_refused(self, content: bytes, problem: str) -> None:
        with pytest.raises(DatasetFormatError, match=problem):
            list(read_rows(content, "f", ("a",), DEFAULT_LIMITS))

    def test_a_table_beyond_the_limit_is_refused(self) -> None:
        with pytest.raises(DatasetFormatError, match="longer than 3 bytes"):
            list(read_rows(b"a\n1\n", "f", ("a",), ImportLimits(file_bytes=3)))

    @given(st.text(st.characters(exclude_categories=["Cs"])))
    def test_any_text_comes_back_through_a_table(self, text: str) -> None:
        file = io.StringIO(newline="")
        CsvTableWriter(file, ("a",)).add([text])
        ((_, row),) = read_rows(file.getvalue().encode(), "f", ("a",), DEFAULT_LIMITS)
        assert row["a"] == text.replace("\r\n", "\n").replace("\r", "\n")

    @pytest.mark.parametrize("text", ["=x", "'=x", "''+x", "'t Veld", "-5", "'-5", "\nx"])
    def test_an_apostrophe_of_the_text_itself_stays(self, text: str) -> None:
        file = io.StringIO(newline="")
        CsvTableWriter(file, ("a",)).add([text])
        ((_, row),) = read_rows(file.getvalue().encode(), "f", ("a",), DEFAULT_LIMITS)
        assert row["a"] == text


class TestNumbersIn:
    @pytest.mark.parametrize(
        "text",
        [
            "[1, -2.5, 3e2]",
            "[array([1., -2.5, 300.])]",
            "[np.float64(1.0), -2.5, 300]",
            "1 -2.5 300",
        ],
    )
    def test_every_spelling_of_a_list(self, text: str) -> None:
        assert parse_number_list(text, 3) == (1.0, -2.5, 300.0)

    @pytest.mark.parametrize(
        "text", ["[1, 2]", "[1, 2, nan]", "[1, 2, x]", "[1, 2, f(3)]", "[1e999, 2, 3]"]
    )
    def test_anything_else_is_refused(self, text: str) -> None:
        with pytest.raises(ValueError, match=r"numbers|large"):
            parse_number_list(text, 3)


class TestIsMissing:
    def test_nothing_and_nan_in_every_spelling(self) -> None:
        assert all(map(is_missing, (None, "", " ", "nan", "NaN", "None")))
        assert not any(map(is_missing, ("0", "0.0", "False", "na")))
