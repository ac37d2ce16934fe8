from __future__ import annotations

import gzip
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from app.formats import viper_reader
from app.formats.file_tree import ImportLimits
from app.formats.report import ReaderReport
from app.formats.trees import open_tree
from app.formats.viper_reader import ViperVideo, is_viper_file, read_viper
from app.soccer.frames import Box, ImagePoint, ImageSize

HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<viper xmlns="http://lamp.cfar.umd.edu/viper#"'
    ' xmlns:data="http://lamp.cfar.umd.edu/viperdata#">\n'
    '<config><descriptor name="BALL" type="OBJECT"/></config>\n'
    '<data><sourcefile filename="cam.mpg"><file id="0" name="Information">'
    '<attribute name="H-FRAME-SIZE"/></file>\n'
)
TAIL = "</sourcefile></data></viper>\n"


def ball(points: str) -> str:
    return f'<object name="BALL" id="0"><attribute name="BallPos">{points}</attribute></object>\n'


def person(identity: int, numbers: str, span: str = "9:9") -> str:
    return (
        f'<object name="Person" id="{identity}"><attribute name="LOCATION">'
        f'<data:bbox framespan="{span}" {numbers}/></attribute></object>\n'
    )


BOX = 'x="1" y="2" width="30" height="40"'


def _read(
    tmp_path: Path, content: str | bytes, report: ReaderReport, name: str = "1.xgtf"
) -> ViperVideo:
    content = content.encode() if isinstance(content, str) else content
    (tmp_path / name).write_bytes(content)
    tree = open_tree(tmp_path, report)
    assert tree is not None
    (track,) = read_viper(tree, name, report, ImportLimits(file_bytes=1_000_000))
    return track


ENDLESS = {
    "a tag": lambda size: f'<attribute name="{"x" * size}"/>',
    "a comment": lambda size: f"<!-- {'<>' * (size // 2)} -->",
    "text": lambda size: "x" * size,
}


class TestReadViper:
    @pytest.mark.parametrize("what", ENDLESS)
    def test_a_megabyte_without_an_element_is_refused(
        self, tmp_path: Path, report: ReaderReport, what: str
    ) -> None:
        points = ball('<data:point framespan="9:9" x="100" y="50"/>')
        text = HEAD + points + ENDLESS[what](900_000) + points + TAIL
        assert _read(tmp_path, text, report).ball_point_count == 1
        assert report.problems == []
        text = HEAD + points + ENDLESS[what](20_000_000) + points + TAIL
        content = gzip.compress(text.encode())
        (tmp_path / "2.xgtf.gz").write_bytes(content)
        tree = open_tree(tmp_path, report)
        assert tree is not None
        (track,) = read_viper(tree, "2.xgtf.gz", report)
        assert track.ball_point_count == 1
        (problem,) = report.problems
        assert problem.problem == "holds more than 1,000,000 bytes without an element"

    @pytest.mark.parametrize("name", ["1.xgtf", "1.xgtf.gz"])
    def test_ball_points_and_boxes_plain_or_packed(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        text = HEAD + ball('<data:point framespan="9:9" x="100" y="50"/>') + person(7, BOX) + TAIL
        content = gzip.compress(text.encode()) if name.endswith("gz") else text.encode()
        track = _read(tmp_path, content, report, name)
        assert track.balls == {9: [(100.0, 50.0)]}
        assert track.persons == {9: [("7", 1.0, 2.0, 30.0, 40.0)]}
        assert report.problems == []

    @pytest.mark.parametrize("span", ["3:5", "3:3 4:5", "3:3,4:4, 5:5"])
    def test_a_framespan_may_be_a_range_or_several(
        self, tmp_path: Path, report: ReaderReport, span: str
    ) -> None:
        text = HEAD + ball(f'<data:point framespan="{span}" x="1" y="2"/>') + TAIL
        assert _read(tmp_path, text, report).balls == {n: [(1.0, 2.0)] for n in (3, 4, 5)}

    def test_blank_numbers_lose_their_own_entry_alone(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        blank = 'x="1" y=" " width="" height=" "'
        text = HEAD + person(7, blank) + person(8, BOX) + TAIL
        track = _read(tmp_path, text, report)
        assert track.person_box_count == 1
        (problem,) = report.problems
        assert str(problem).endswith("1.xgtf, Person 7, framespan 9:9: y is blank")

    @pytest.mark.parametrize("span", ["", "5:3", "a:b", "1", "0:99999999", "0:99999", "-1:3"])
    def test_a_wrong_framespan_is_reported(
        self, tmp_path: Path, report: ReaderReport, span: str
    ) -> None:
        text = HEAD + person(7, BOX, span) + person(8, BOX) + TAIL
        assert _read(tmp_path, text, report).person_box_count == 1
        assert report.problems[0].field == f"framespan {span}"

    def test_a_framespan_beyond_the_limit_is_named_with_file_object_and_limit(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        spans = ("0:99999", "0:9999 10000:10000", "0:9999")
        points = "".join(f'<data:point framespan="{span}" x="1" y="2"/>' for span in spans)
        assert len(_read(tmp_path, HEAD + ball(points) + TAIL, report).balls) == 10_000
        whole, parts = map(str, report.problems)
        assert whole.endswith(
            "1.xgtf, Ball 0, framespan 0:99999: is left out: it covers 100,000 frames, and the limit is 10,000"
        )
        assert "covers 10,001 frames" in parts

    def test_a_file_has_a_bounded_number_of_frames_with_a_ball(
        self, tmp_path: Path, report: ReaderReport, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(viper_reader, "MAX_FRAMES", 10)
        points = "".join(
            f'<data:point framespan="{span}" x="1" y="{y}"/>'
            for y, span in enumerate(("0:7", "4:9", "9:10", "0:9"))
        )
        assert sorted(_read(tmp_path, HEAD + ball(points) + TAIL, report).balls) == [*range(10)]
        (problem,) = report.problems
        assert problem.field == "framespan 9:10"
        assert problem.problem == "has more than 10 frames with a ball"

    def test_two_balls_in_one_frame_are_both_kept_and_a_repeated_one_once(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        points = "".join(f'<data:point framespan="9:9" x="{x}" y="2"/>' for x in (1, 1, 5))
        assert _read(tmp_path, HEAD + ball(points) + TAIL, report).balls == {
            9: [(1.0, 2.0), (5.0, 2.0)]
        }

    def test_other_attributes_of_the_ball_are_kept(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        text = (
            '<object name="BALL" id="0"><attribute name="BallShot">'
            '<data:bvalue framespan="9:9" value="true"/></attribute></object>'
        )
        assert _read(tmp_path, HEAD + text + TAIL, report).ball_notes == {9: {"BallShot": "true"}}

    def test_a_file_that_ends_early_keeps_what_was_read(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        text = HEAD + person(7, BOX) + person(8, BOX)[:40]
        assert _read(tmp_path, text, report).person_box_count == 1
        assert "0 ball points and 1 persons before it are kept" in str(report.problems[0])

    def test_a_packed_file_that_ends_early_keeps_what_was_read(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        text = HEAD + "".join(person(number, BOX) for number in range(3000)) + TAIL
        content = gzip.compress(text.encode())
        track = _read(tmp_path, content[: len(content) // 2], report, "1.xgtf.gz")
        assert 0 < track.person_box_count < 3000
        assert "damaged or cut off" in str(report.problems[0])

    @pytest.mark.parametrize(
        "doctype",
        [
            '<!DOCTYPE viper [<!ENTITY a "b">]>',
            '<!DOCTYPE viper SYSTEM "file:///etc/passwd">',
            '<!DOCTYPE a [<!ENTITY x "xx"><!ENTITY y "&x;&x;">]>',
        ],
    )
    def test_a_dtd_is_refused(self, tmp_path: Path, report: ReaderReport, doctype: str) -> None:
        text = HEAD.replace("<viper", doctype + "<viper", 1) + person(7, BOX) + TAIL
        assert _read(tmp_path, text, report).person_box_count == 0
        assert "DTD or an entity" in str(report.problems[0])

    def test_a_packed_bomb_is_refused(self, tmp_path: Path, report: ReaderReport) -> None:
        content = gzip.compress(HEAD.encode() + b" " * 5_000_000)
        _read(tmp_path, content, report, "1.xgtf.gz")
        assert "longer than 1,000,000 bytes" in str(report.problems[0])

    def test_spans_that_unfold_without_end_are_refused(
        self, tmp_path: Path, report: ReaderReport, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.formats.viper_reader.MAX_ENTRIES", 1000)
        text = HEAD + "".join(person(number, BOX, "1:400") for number in range(5)) + TAIL
        assert _read(tmp_path, text, report).person_box_count == 800
        assert "holds more than 1,000 entries" in str(report.problems[0])

    @pytest.mark.parametrize("encoding", ["shift_jis", "no-such-code"])
    def test_another_encoding_is_reported(
        self, tmp_path: Path, report: ReaderReport, encoding: str
    ) -> None:
        _read(tmp_path, HEAD.replace("UTF-8", encoding) + TAIL, report)
        assert len(report.problems) == 1

    def test_a_member_of_a_zip_that_is_damaged_is_reported(
        self, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"1.xgtf": HEAD + person(7, BOX) * 2000 + TAIL})
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
        tree = open_tree(path, report)
        assert tree is not None
        read_viper(tree, "1.xgtf", report)
        tree.close()
        assert len(report.problems) == 1

    def test_memory_does_not_grow_with_the_file(self, tmp_path: Path, report: ReaderReport) -> None:
        text = HEAD + "<object>" + "<a/>" * 20_000 + "</object>" + "<a/>" * 20_000 + TAIL
        tracemalloc.start()
        try:
            _read(tmp_path, text, report)
            assert tracemalloc.get_traced_memory()[1] < 2_000_000
        finally:
            tracemalloc.stop()

    def test_something_else_is_reported(self, tmp_path: Path, report: ReaderReport) -> None:
        _read(tmp_path, b"\x89PNG\r\n", report)
        assert "not sound XML" in str(report.problems[0])


def ball_as(entry: str, name: str = "BALL") -> str:
    return (
        HEAD + f'<object name="{name}" id="0" framespan="9:9"><attribute name="LOCATION">{entry}'
        f"</attribute></object>" + TAIL
    )


class TestShapes:
    @pytest.mark.parametrize(
        ("entry", "balls"),
        [
            ('<data:point framespan="9:9" x="641" y="318"/>', [ImagePoint(641, 318)]),
            (
                '<data:bbox framespan="9:9" x="637" y="314" width="8" height="8"/>',
                [Box(637, 314, 8, 8)],
            ),
            ('<data:circle framespan="9:9" x="641" y="318" radius="4"/>', [Box(637, 314, 8, 8)]),
            (
                '<data:bbox framespan="9:9" x="637" y="314" width="0" height="8"/>',
                [ImagePoint(637, 318)],
            ),
            ('<data:circle framespan="9:9" x="641" y="318" radius="0"/>', [ImagePoint(641, 318)]),
            # The entry holds as long as its object.
            ('<data:point x="641" y="318"/>', [ImagePoint(641, 318)]),
        ],
    )
    def test_a_ball_may_be_a_point_a_box_or_a_circle(
        self, tmp_path: Path, report: ReaderReport, entry: str, balls: list[ImagePoint | Box]
    ) -> None:
        assert _read(tmp_path, ball_as(entry), report).balls == {9: balls}
        assert report.problems == []

    @pytest.mark.parametrize("boxed_first", [False, True])
    def test_a_centre_inside_a_box_is_the_same_ball(
        self, tmp_path: Path, report: ReaderReport, boxed_first: bool
    ) -> None:
        entries = [
            '<data:point framespan="9:9" x="640" y="319"/>',
            '<data:bbox framespan="9:9" x="637" y="314" width="8" height="8"/>',
        ]
        text = ball_as("".join(reversed(entries) if boxed_first else entries))
        assert _read(tmp_path, text, report).balls == {9: [ImagePoint(640, 319)]}

    @pytest.mark.parametrize(
        "name",
        ["BALL", "Football", "soccer ball", "Soccer-Ball", "ball_1", "BALLS", "Ballon", "pelota"],
    )
    def test_a_ball_has_several_names(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        text = ball_as('<data:point framespan="9:9" x="1" y="2"/>', name)
        assert _read(tmp_path, text, report).ball_point_count == 1

    @pytest.mark.parametrize(
        ("name", "entry", "what"),
        [
            ("PLAYER", f"<data:bbox {BOX}/>", "bbox"),
            ("BALL", f'<data:obox {BOX} rotation="3"/>', "obox"),
            ("BALL", f"<data:ellipse {BOX}/>", "ellipse"),
            ("Person", '<data:point x="1" y="2"/>', "point"),
            ("Basketball", '<data:point x="1" y="2"/>', "point"),
            ("Ballboy", '<data:point x="1" y="2"/>', "point"),
            ("FRAME", '<data:bvalue value="true"/>', "bvalue"),
        ],
    )
    def test_what_is_left_out_is_named_with_object_and_shape(
        self, tmp_path: Path, report: ReaderReport, name: str, entry: str, what: str
    ) -> None:
        track = _read(tmp_path, ball_as(entry * 3, name), report)
        assert (track.ball_point_count, track.person_box_count) == (0, 0)
        (problem,) = report.problems
        assert (problem.record, problem.field) == (f"object {name}", f"LOCATION, {what}")
        assert problem.problem.startswith("3 entries are left out: balls are read as point, bbox")

    def test_a_file_of_endless_kinds_of_objects_names_a_hundred(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        objects = "".join(
            f'<object name="thing {number}"><attribute name="A"><data:bvalue value="true"/>'
            "</attribute></object>"
            for number in range(300)
        )
        _read(tmp_path, HEAD + objects + TAIL, report)
        assert len(report.problems) == 101
        assert "200 entries are left out" in report.problems[-1].problem


class TestNamespaces:
    @pytest.mark.parametrize(
        ("head", "prefix"),
        [
            (HEAD, "data"),
            (HEAD.replace("viper#", "viper").replace("viperdata#", "viperdata"), "data"),
            (HEAD.replace("xmlns:data", "xmlns:d"), "d"),
            (HEAD.replace(' xmlns="http://lamp.cfar.umd.edu/viper#"', ""), "data"),
        ],
    )
    def test_elements_count_under_any_namespace(
        self, tmp_path: Path, report: ReaderReport, head: str, prefix: str
    ) -> None:
        text = head + ball(f'<{prefix}:point framespan="9:9" x="1" y="2"/>') + TAIL
        assert _read(tmp_path, text, report).balls == {9: [(1.0, 2.0)]}
        assert report.problems == []

    def test_all_elements_may_have_a_prefix(self, tmp_path: Path, report: ReaderReport) -> None:
        text = (
            '<v:viper xmlns:v="http://lamp.cfar.umd.edu/viper#" xmlns:d="urn:d"><v:data>'
            '<v:sourcefile filename="a.avi"><v:object name="BALL" id="0">'
            '<v:attribute name="P"><d:point framespan="9:9" x="1" y="2"/></v:attribute>'
            "</v:object></v:sourcefile></v:data></v:viper>"
        )
        assert _read(tmp_path, text, report).balls == {9: [(1.0, 2.0)]}


def sized(width: str, height: str) -> str:
    sides = zip(("H-FRAME-SIZE", "V-FRAME-SIZE"), (width, height), strict=True)
    values = "".join(
        f'<attribute name="{name}"><data:dvalue value="{value}"/></attribute>'
        for name, value in sides
    )
    return HEAD.replace('<attribute name="H-FRAME-SIZE"/>', values)


class TestSize:
    def test_the_size_of_the_frames_is_read(self, tmp_path: Path, report: ReaderReport) -> None:
        assert _read(tmp_path, sized("1280", "720") + TAIL, report).size == ImageSize(1280, 720)

    @pytest.mark.parametrize(("width", "height"), [("", ""), ("1280", "")])
    def test_a_blank_side_is_no_size(
        self, tmp_path: Path, report: ReaderReport, width: str, height: str
    ) -> None:
        assert _read(tmp_path, sized(width, height) + TAIL, report).size is None
        assert report.problems == []

    @pytest.mark.parametrize("side", ["0", "-720", "huge", "1e9", "7.5"])
    def test_an_impossible_side_is_reported(
        self, tmp_path: Path, report: ReaderReport, side: str
    ) -> None:
        assert _read(tmp_path, sized("1280", side) + TAIL, report).size is None
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("V-FRAME-SIZE", "value")


class TestSources:
    def test_each_source_is_a_track(self, tmp_path: Path, report: ReaderReport) -> None:
        point = ball('<data:point framespan="9:9" x="1" y="2"/>')
        text = (
            HEAD
            + point
            + TAIL.replace(
                "</sourcefile>",
                f'</sourcefile><sourcefile filename="b.avi">{point * 2}</sourcefile>',
            )
        )
        (tmp_path / "1.xgtf").write_text(text)
        tree = open_tree(tmp_path, report)
        assert tree is not None
        tracks = read_viper(tree, "1.xgtf", report)
        assert [(track.source, track.ball_point_count) for track in tracks] == [
            ("cam.mpg", 1),
            ("b.avi", 1),
        ]


class TestIsViper:
    @pytest.mark.parametrize(
        ("content", "is_one"),
        [
            (HEAD, True),
            (HEAD.replace("<viper", "<v:viper"), True),
            ("<annotations><viperish/></annotations>", False),
            ("", False),
        ],
    )
    def test_is_told_by_the_root(
        self, tmp_path: Path, report: ReaderReport, content: str, is_one: bool
    ) -> None:
        (tmp_path / "1.xml").write_text(content)
        (tmp_path / "2.xml.gz").write_bytes(gzip.compress(content.encode()))
        tree = open_tree(tmp_path, report)
        assert tree is not None
        assert [is_viper_file(tree, name) for name in ("1.xml", "2.xml.gz")] == [is_one, is_one]
