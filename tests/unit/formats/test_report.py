from __future__ import annotations

from app.formats.report import MAX_PROBLEMS, ReaderReport


class TestReport:
    def test_a_problem_names_file_record_and_field(self, report: ReaderReport) -> None:
        report.add_problem_at("a/Labels-v3.json", "7.png", "lines[2]", "is not an object")
        assert str(report.problems[0]) == "a/Labels-v3.json, 7.png, lines[2]: is not an object"

    def test_problems_beyond_the_cap_are_counted(self, report: ReaderReport) -> None:
        for _ in range(MAX_PROBLEMS + 3):
            report.add_problem_at("f", None, None, "is wrong")
        assert len(report.problems) == MAX_PROBLEMS
        assert report.dropped == 3
