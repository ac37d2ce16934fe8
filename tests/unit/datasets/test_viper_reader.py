from __future__ import annotations

import gzip
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from app.datasets import viper_reader
from app.datasets.file_tree import Limits
from app.datasets.report import Report
from app.datasets.trees import open_tree
from app.datasets.viper_reader import ViperTrack, read_viper

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


def _read(tmp_path: Path, content: str | bytes, report: Report, name: str = "1.xgtf") -> ViperTrack:
    content = content.encode() if isinstance(content, str) else content
    (tmp_path / name).write_bytes(content)
    tree = open_tree(tmp_path, report)
    assert tree is not None
    return read_viper(tree, name, report, Limits(file_bytes=1_000_000))


ENDLESS = {
    "a tag": lambda size: f'<attribute name="{"x" * size}"/>',
    "a comment": lambda size: f"<!-- {'<>' * (size // 2)} -->",
    "text": lambda size: "x" * size,
}


class TestReadViper:
    @pytest.mark.parametrize("what", ENDLESS)
    def test_a_megabyte_without_an_element_is_refused(
        self, tmp_path: Path, report: Report, what: str
    ) -> None:
        points = ball('<data:point framespan="9:9" x="100" y="50"/>')
        text = HEAD + points + ENDLESS[what](900_000) + points + TAIL
        assert _read(tmp_path, text, report).ball_points == 1
        assert report.problems == []
        text = HEAD + points + ENDLESS[what](20_000_000) + points + TAIL
        content = gzip.compress(text.encode())
        (tmp_path / "2.xgtf.gz").write_bytes(content)
        tree = open_tree(tmp_path, report)
        assert tree is not None
        track = read_viper(tree, "2.xgtf.gz", report)
        assert track.ball_points == 1
        (problem,) = report.problems
        assert problem.problem == "holds more than 1,000,000 bytes without an element"

    @pytest.mark.parametrize("name", ["1.xgtf", "1.xgtf.gz"])
    def test_ball_points_and_boxes_plain_or_packed(
        self, tmp_path: Path, report: Report, name: str
    ) -> None:
        text = HEAD + ball('<data:point framespan="9:9" x="100" y="50"/>') + person(7, BOX) + TAIL
        content = gzip.compress(text.encode()) if name.endswith("gz") else text.encode()
        track = _read(tmp_path, content, report, name)
        assert track.balls == {9: [(100.0, 50.0)]}
        assert track.persons == {9: [("7", 1.0, 2.0, 30.0, 40.0)]}
        assert report.problems == []

    @pytest.mark.parametrize("span", ["3:5", "3:3 4:5", "3:3,4:4, 5:5"])
    def test_a_framespan_may_be_a_range_or_several(
        self, tmp_path: Path, report: Report, span: str
    ) -> None:
        text = HEAD + ball(f'<data:point framespan="{span}" x="1" y="2"/>') + TAIL
        assert _read(tmp_path, text, report).balls == {n: [(1.0, 2.0)] for n in (3, 4, 5)}

    def test_blank_numbers_lose_their_own_entry_alone(self, tmp_path: Path, report: Report) -> None:
        blank = 'x="1" y=" " width="" height=" "'
        text = HEAD + person(7, blank) + person(8, BOX) + TAIL
        track = _read(tmp_path, text, report)
        assert track.person_boxes == 1
        (problem,) = report.problems
        assert str(problem).endswith("1.xgtf, Person 7, framespan 9:9: y is blank")

    @pytest.mark.parametrize("span", ["", "5:3", "a:b", "1", "0:99999999", "0:99999", "-1:3"])
    def test_a_wrong_framespan_is_reported(self, tmp_path: Path, report: Report, span: str) -> None:
        text = HEAD + person(7, BOX, span) + person(8, BOX) + TAIL
        assert _read(tmp_path, text, report).person_boxes == 1
        assert report.problems[0].field == f"framespan {span}"

    def test_a_framespan_beyond_the_limit_is_named_with_file_object_and_limit(
        self, tmp_path: Path, report: Report
    ) -> None:
        spans = ("0:99999", "0:9999 10000:10000", "0:9999")
        points = "".join(f'<data:point framespan="{span}" x="1" y="2"/>' for span in spans)
        assert len(_read(tmp_path, HEAD + ball(points) + TAIL, report).balls) == 10_000
        whole, parts = map(str, report.problems)
        assert whole.endswith(
            "1.xgtf, Ball 0, framespan 0:99999: covers 100,000 frames; at most 10,000 are read"
        )
        assert "covers 10,001 frames" in parts

    def test_a_file_has_a_bounded_number_of_frames_with_a_ball(
        self, tmp_path: Path, report: Report, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(viper_reader, "MAX_FRAMES", 10)
        points = "".join(
            f'<data:point framespan="{span}" x="1" y="{y}"/>'
            for y, span in enumerate(("0:7", "4:9", "9:10", "0:9"))
        )
        assert sorted(_read(tmp_path, HEAD + ball(points) + TAIL, report).balls) == [*range(10)]
        (problem,) = report.problems
        assert problem.field == "framespan 9:10"
        assert problem.problem == "is beyond 10 frames with a ball"

    def test_two_balls_in_one_frame_are_both_kept_and_a_repeated_one_once(
        self, tmp_path: Path, report: Report
    ) -> None:
        points = "".join(f'<data:point framespan="9:9" x="{x}" y="2"/>' for x in (1, 1, 5))
        assert _read(tmp_path, HEAD + ball(points) + TAIL, report).balls == {
            9: [(1.0, 2.0), (5.0, 2.0)]
        }

    def test_other_attributes_of_the_ball_are_kept(self, tmp_path: Path, report: Report) -> None:
        text = (
            '<object name="BALL" id="0"><attribute name="BallShot">'
            '<data:bvalue framespan="9:9" value="true"/></attribute></object>'
        )
        assert _read(tmp_path, HEAD + text + TAIL, report).ball_notes == {9: {"BallShot": "true"}}

    def test_a_file_that_ends_early_keeps_what_was_read(
        self, tmp_path: Path, report: Report
    ) -> None:
        text = HEAD + person(7, BOX) + person(8, BOX)[:40]
        assert _read(tmp_path, text, report).person_boxes == 1
        assert "0 ball points and 1 persons before it are kept" in str(report.problems[0])

    def test_a_packed_file_that_ends_early_keeps_what_was_read(
        self, tmp_path: Path, report: Report
    ) -> None:
        text = HEAD + "".join(person(number, BOX) for number in range(3000)) + TAIL
        content = gzip.compress(text.encode())
        track = _read(tmp_path, content[: len(content) // 2], report, "1.xgtf.gz")
        assert 0 < track.person_boxes < 3000
        assert "damaged or cut off" in str(report.problems[0])

    @pytest.mark.parametrize(
        "doctype",
        [
            '<!DOCTYPE viper [<!ENTITY a "b">]>',
            '<!DOCTYPE viper SYSTEM "file:///etc/passwd">',
            '<!DOCTYPE a [<!ENTITY x "xx"><!ENTITY y "&x;&x;">]>',
        ],
    )
    def test_a_dtd_is_refused(self, tmp_path: Path, report: Report, doctype: str) -> None:
        text = HEAD.replace("<viper", doctype + "<viper", 1) + person(7, BOX) + TAIL
        assert _read(tmp_path, text, report).person_boxes == 0
        assert "DTD or an entity" in str(report.problems[0])

    def test_a_packed_bomb_is_refused(self, tmp_path: Path, report: Report) -> None:
        content = gzip.compress(HEAD.encode() + b" " * 5_000_000)
        _read(tmp_path, content, report, "1.xgtf.gz")
        assert "longer than 1,000,000 bytes" in str(report.problems[0])

    def test_spans_that_unfold_without_end_are_refused(
        self, tmp_path: Path, report: Report, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.datasets.viper_reader.MAX_ENTRIES", 1000)
        text = HEAD + "".join(person(number, BOX, "1:400") for number in range(5)) + TAIL
        assert _read(tmp_path, text, report).person_boxes == 800
        assert "holds more than 1,000 entries" in str(report.problems[0])

    @pytest.mark.parametrize("encoding", ["shift_jis", "no-such-code"])
    def test_another_encoding_is_reported(
        self, tmp_path: Path, report: Report, encoding: str
    ) -> None:
        _read(tmp_path, HEAD.replace("UTF-8", encoding) + TAIL, report)
        assert len(report.problems) == 1

    def test_a_member_of_a_zip_that_is_damaged_is_reported(
        self, make_zip: Callable[..., Path], report: Report
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

    def test_memory_does_not_grow_with_the_file(self, tmp_path: Path, report: Report) -> None:
        text = HEAD + "<object>" + "<a/>" * 20_000 + "</object>" + "<a/>" * 20_000 + TAIL
        tracemalloc.start()
        try:
            _read(tmp_path, text, report)
            assert tracemalloc.get_traced_memory()[1] < 2_000_000
        finally:
            tracemalloc.stop()

    def test_something_else_is_reported(self, tmp_path: Path, report: Report) -> None:
        _read(tmp_path, b"\x89PNG\r\n", report)
        assert "not sound XML" in str(report.problems[0])
