from __future__ import annotations

import csv
import io
from dataclasses import replace

from app.evaluation.result import (
    Axis,
    Cell,
    Chart,
    Column,
    Panel,
    Row,
    Series,
    Table,
    figure_to_csv,
    table_to_csv,
)


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


class TestFigureCsv:
    def test_keeps_every_digit_and_leaves_empty_what_is_missing(self) -> None:
        one = Series("a", "A", (0.1 + 0.2, 1.0), (2.0, 3.0), low=(1.0, 2.0), high=(3.0, 4.0))
        two = Series("=b", "B", (5.0,), (6.0,), count=(7,), group_id=12)
        panel = Panel("P", Axis("x"), Axis("y"), (one, two))
        found = rows(figure_to_csv(Chart("f", "F", (panel,))))
        assert [row["x"] for row in found] == ["0.30000000000000004", "1.0", "5.0"]
        assert (found[0]["low"], found[0]["count"], found[2]["low"]) == ("1.0", "", "")
        assert (found[2]["count"], found[2]["group_id"]) == ("7", "12")
        # A spreadsheet would run it.
        assert found[2]["series"] == "'=b"

    def test_the_header_says_what_the_axes_show(self) -> None:
        one = Panel("P", Axis("Change", "%"), Axis("Moves by", "m"), (), color=Axis("Far", "m"))
        two = replace(one, x=Axis("Shift", "px"))
        header = figure_to_csv(Chart("f", "F", (one, two))).splitlines()[0]
        assert header == (
            "panel,series,kind,Change (%) / Shift (px),Moves by (m),low,high,count,Far (m),group_id"
        )


class TestTableCsv:
    def test_a_number_goes_with_its_denominators(self) -> None:
        cells = (Cell(0.5, 0.25, 0.75, 3, 4), Cell(None, count=0, of=4))
        table = Table("t", "T", (Column("a", "A"), Column("b", "B")), (Row("r", "R", cells),))
        (row,) = rows(table_to_csv(table))
        assert row == {
            "row": "r",
            "a": "0.5", "a_low": "0.25", "a_high": "0.75", "a_count": "3", "a_of": "4",
            "b": "", "b_low": "", "b_high": "", "b_count": "0", "b_of": "4",
        }  # fmt: skip
