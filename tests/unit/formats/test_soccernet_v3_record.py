from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import DatasetFormatError
from app.formats.report import ReaderReport
from app.formats.soccernet_v3 import ImageRecord, record_from_json, record_to_json
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Station, View

MakeImage = Callable[..., dict[str, Any]]
JUNK = st.dictionaries(
    st.sampled_from(["class", "points", "x1", "y1", "x2", "y2", "ID", "set", "lines", "balls"]),
    st.none()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=3)
    | st.lists(st.integers(), max_size=3),
)
BALL = {"x1": 610, "y1": 300, "x2": 622, "y2": 311}


def _view(record: ImageRecord) -> View:
    station = Station("s", record.size, lines=record.lines)
    return View("7.png", station, record.balls, extras=record.extras)


def _read(value: Any, report: ReaderReport | None = None) -> ImageRecord:
    return record_from_json(value, "Labels-v3.json", "7.png", report or ReaderReport())


class TestRecordFromJson:
    @pytest.mark.parametrize("name", ["Ball", "ball ", "Sports_Ball", "football", "Balls"])
    def test_the_ball_is_known_in_every_spelling(self, image: MakeImage, name: str) -> None:
        value = image(bboxes=[{"class": name, "ID": None, "points": BALL}])
        assert len(_read(value).balls) == 1

    def test_ball_lines_and_size_become_annotations(self, image: MakeImage) -> None:
        record = _read(image())
        assert record.size == ImageSize(1280, 720)
        assert record.balls == (BallAnnotation(box=Box(610.0, 300.0, 12.0, 11.0)),)
        assert record.lines["Goal left post left"] == ((20.0, 100.0), (22.0, 160.5))
        assert len(record.lines["Side line top"]) == 3

    def test_people_null_classes_and_metadata_go_to_extras_unchanged(
        self, image: MakeImage
    ) -> None:
        value = image(extra={"deep": [1, "2"]})
        extras = _read(value).extras
        assert extras.boxes == (value["bboxes"][1],)
        assert extras.lines == ({"class": None, "points": [1, 2, 3, 4]},)
        assert extras.metadata["imageMetadata"] == value["imageMetadata"]
        assert extras.metadata["record"] == {"extra": {"deep": [1, "2"]}}

    def test_corners_come_in_any_order_and_as_text(self, image: MakeImage) -> None:
        points = {"x1": "622.0", "y1": 311.0, "x2": 610, "y2": "300"}
        record = _read(image(bboxes=[{"class": "Ball", "ID": None, "points": points}]))
        assert record.balls[0].box == Box(610.0, 300.0, 12.0, 11.0)

    def test_width_and_height_may_be_text_or_floats(self, image: MakeImage) -> None:
        record = _read(image(imageMetadata={"width": "1366", "height": 768.0}))
        assert record.size == ImageSize(1366, 768)

    def test_several_balls_are_all_kept(self, image: MakeImage) -> None:
        record = _read(image(bboxes=[{"class": "Ball", "points": BALL}] * 2))
        assert len(record.balls) == 2
        assert _view(record).ball is None

    def test_a_ball_box_without_area_is_its_centre(self, image: MakeImage) -> None:
        points = {"x1": 610, "y1": 300, "x2": 610, "y2": 300}
        record = _read(image(bboxes=[{"class": "Ball", "points": points}]))
        assert record.balls == (BallAnnotation(point=ImagePoint(610.0, 300.0)),)

    def test_two_lines_of_one_class_are_joined(self, image: MakeImage) -> None:
        line = {"class": "Middle line", "points": [1, 2, 3, 4]}
        assert len(_read(image(lines=[line, line])).lines["Middle line"]) == 4

    def test_an_unknown_marking_is_reported_and_kept(
        self, image: MakeImage, report: ReaderReport
    ) -> None:
        lines = [
            {"class": "Corner flag", "points": [1, 2]},
            {"class": "Line unknown", "points": [1, 2]},
            {"class": "Middle line", "points": [1, 2, 3, 4]},
        ]
        record = _read(image(lines=lines), report)
        assert list(record.lines) == ["Middle line"]
        assert record.extras.lines == tuple(lines[:2])
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("7.png", "lines[0].class")

    @pytest.mark.parametrize(
        ("line", "where"),
        [
            ({"class": "Middle line", "points": [1, 2, 3]}, "lines[0].points"),
            ({"class": "Middle line", "points": [1, "a"]}, "lines[0].points"),
            ({"class": "Middle line", "points": {"x": 1}}, "lines[0].points"),
            ({"class": "Middle line"}, "lines[0].points"),
            ({"class": 5, "points": [1, 2]}, "lines[0].class"),
            (5, "lines[0]"),
        ],
    )
    def test_a_line_of_wrong_types_is_reported_by_place(
        self, image: MakeImage, report: ReaderReport, line: Any, where: str
    ) -> None:
        good = {"class": "Circle left", "points": [1, 2]}
        record = _read(image(lines=[line, good]), report)
        assert list(record.lines) == ["Circle left"]
        assert [problem.field for problem in report.problems] == [where]
        assert record.extras.lines == ((line,) if isinstance(line, dict) else ())

    @pytest.mark.parametrize(
        "points", [None, [], {}, {"x1": 1}, BALL | {"x1": "left"}, BALL | {"y2": None}]
    )
    def test_a_ball_of_wrong_types_is_reported_and_kept(
        self, image: MakeImage, report: ReaderReport, points: Any
    ) -> None:
        box = {"class": "Ball", "points": points}
        record = _read(image(bboxes=[box]), report)
        assert record.balls == ()
        assert record.extras.boxes == (box,)
        assert report.problems[0].field == "bboxes[0].points"

    @pytest.mark.parametrize("name", ["bboxes", "lines"])
    def test_a_list_of_wrong_type_is_reported_and_the_rest_read(
        self, image: MakeImage, report: ReaderReport, name: str
    ) -> None:
        _read(image(**{name: 5}), report)
        assert [problem.field for problem in report.problems] == [name]

    @pytest.mark.parametrize(
        ("metadata", "field"),
        [
            (None, "imageMetadata"),
            ({}, "imageMetadata.width"),
            ({"width": 1280}, "imageMetadata.height"),
            ({"width": 1280, "height": "tall"}, "imageMetadata.height"),
            ({"width": 0, "height": 720}, "imageMetadata.width"),
            ({"width": 99999, "height": 720}, "imageMetadata.width"),
        ],
    )
    def test_without_a_size_the_image_is_refused(
        self, image: MakeImage, metadata: Any, field: str
    ) -> None:
        with pytest.raises(DatasetFormatError) as caught:
            _read(image(imageMetadata=metadata))
        assert caught.value.field == field

    @given(JUNK, JUNK, JUNK)
    def test_whatever_a_record_holds_it_goes_out_again(
        self, boxes: Any, lines: Any, metadata: Any
    ) -> None:
        value = {
            "imageMetadata": metadata | {"width": 1280, "height": 720},
            "bboxes": [boxes, {"class": "Ball", "points": boxes}],
            "lines": [lines, {"class": "Middle line", "points": list(lines.values())}],
            **metadata,
        }
        written = record_to_json(_view(_read(value)))
        again = _read(json.loads(json.dumps(written)))
        assert again == _read(written)


class TestRecordToJson:
    def test_what_came_in_goes_out(self, image: MakeImage) -> None:
        value = image(extra=1)
        written = record_to_json(_view(_read(value)), "train")
        assert sorted(map(str, written["lines"])) == sorted(
            str(line | {"points": [float(p) for p in line["points"]]} if line["class"] else line)
            for line in value["lines"]
        )
        assert written["bboxes"] == value["bboxes"]
        assert written["imageMetadata"] == value["imageMetadata"]
        assert written["extra"] == 1

    def test_the_sources_own_spelling_of_the_size_stays(self, image: MakeImage) -> None:
        record = _read(image(imageMetadata={"width": "1280", "height": 720.0}))
        assert record_to_json(_view(record))["imageMetadata"] == {"width": "1280", "height": 720.0}

    def test_other_fields_of_a_ball_stay_with_it(self, image: MakeImage) -> None:
        box = {"class": "Ball", "ID": "a", "points": BALL, "by": "annotator 3"}
        record = _read(image(bboxes=[box]))
        assert record_to_json(_view(record))["bboxes"] == [box]

    def test_an_occluded_ball_and_a_point_come_back(self, image: MakeImage) -> None:
        record = _read(image())
        balls = (
            BallAnnotation(box=Box(1.0, 2.0, 3.0, 4.0), occluded=True),
            BallAnnotation(point=ImagePoint(5.5, 6.5)),
            BallAnnotation(out_of_view=True),
        )
        written = record_to_json(_view(replace(record, balls=balls)))
        assert _read(written).balls == balls[:2]

    def test_a_view_of_our_own_gets_the_metadata_a_reader_needs(self) -> None:
        view = View("7.png", Station("s", ImageSize(854, 480)), extras=Extras(metadata={"half": 2}))
        assert record_to_json(view, "test")["imageMetadata"] == {
            "half": 2, "width": 854, "height": 480, "set": "test",
        }  # fmt: skip

    @given(
        st.lists(st.tuples(*[st.floats(-100, 2000)] * 4), max_size=3),
        st.lists(st.floats(-100, 2000), min_size=2, max_size=8).filter(lambda p: len(p) % 2 == 0),
    )
    def test_import_export_import_gives_the_same_annotations(
        self, boxes: list[tuple[float, ...]], points: list[float]
    ) -> None:
        value = {
            "imageMetadata": {"width": 1280, "height": 720},
            "bboxes": [
                {"class": "Ball", "points": dict(zip(("x1", "y1", "x2", "y2"), box, strict=True))}
                for box in boxes
            ],
            "lines": [{"class": "Goal left post left ", "points": points}],
        }
        first = _read(value)
        again = _read(json.loads(json.dumps(record_to_json(_view(first)))))
        assert (again.balls, again.lines, again.size) == (first.balls, first.lines, first.size)
        assert make_lines(again.lines) == first.lines
