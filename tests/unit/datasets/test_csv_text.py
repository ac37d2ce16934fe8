from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

from app.datasets.csv_text import Table, cell, plain_list


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
        assert cell(value) == text

    @pytest.mark.parametrize(
        "text", ["=1+2", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "=HYPERLINK()"]
    )
    def test_a_formula_is_escaped(self, text: str) -> None:
        assert cell(text) == f"'{text}"

    @pytest.mark.parametrize("text", ["-5", "+1.5", "-1e-7", "-.5"])
    def test_the_text_of_a_number_is_untouched(self, text: str) -> None:
        assert cell(text) == text


class TestPlainList:
    def test_every_digit_and_no_numpy(self) -> None:
        assert plain_list([np.float64(0.1), 2.0]) == "[0.1, 2.0]"
        assert plain_list([3, 4]) == "[3, 4]"


class TestTable:
    def test_the_index_column_comes_first_and_has_no_name(self) -> None:
        file = io.StringIO()
        table = Table(file, ["a", "b"])
        table.add([1.5, None])
        table.add(["x,y", False])
        assert file.getvalue() == ',a,b\n0,1.5,\n1,"x,y",False\n'
        assert table.rows == 2
