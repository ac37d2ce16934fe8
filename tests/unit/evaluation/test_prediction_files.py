from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import DatasetFormatError, InputError
from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.evaluation.prediction_files import read_predicted_cameras, read_predictions
from app.formats.camera_json import camera_to_json
from app.soccer.frames import Box, ImageSize
from tests.cameras import SIZE
from tests.unit.evaluation.conftest import camera_at

MATCH = "league/2030-2031/2030-08-17 - 18-00 Alder 3 - 1 Birch"


@pytest.fixture
def names() -> FrameNameIndex:
    frames = [
        NamedFrame(number, f"{MATCH}/7.png", view, MATCH, SIZE)
        for number, view in enumerate(("7.png", "7_1.png"), 1)
    ]
    return FrameNameIndex.of([*frames, NamedFrame(9, "358", "cam3", "issia", SIZE, station="cam3")])


def write(path: Path, value: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return path


def result(image: object = f"{MATCH}/7.png", **more: object) -> dict[str, object]:
    return {"image_id": image, "category_id": 1, "bbox": [10, 20, 8, 9], "score": 0.5, **more}


def problems(found) -> list[tuple[str | None, str | None, str]]:
    return [(item.record, item.field, item.problem) for item in found.report.problems]


CSV = f"image,x,y,w,h,score\n{MATCH}/7.png,10,20,8,9,0.5\n"
YOLO = "0 0.5 0.5 0.01 0.01 0.5\n"


class TestReadAuto:
    @pytest.mark.parametrize(
        ("format_", "name", "content"),
        [
            ("coco", "a.json", [result()]),
            ("csv", "a.csv", CSV),
            ("yolo", "labels/7.txt", YOLO),
        ],
    )
    def test_the_ending_of_the_files_tells_the_format(
        self, tmp_path, names, format_, name, content
    ) -> None:
        path = write(tmp_path / name, content)
        for place in (path, path.parent):
            assert read_predictions(place, "auto", names).format == format_

    def test_a_track_as_parquet_alone_is_named(self, tmp_path: Path, names) -> None:
        write(tmp_path / "ball.parquet", "PAR1")
        with pytest.raises(DatasetFormatError, match=r"give ball\.csv, which an export of tracks"):
            read_predictions(tmp_path, "auto", names)

    def test_a_folder_with_several_formats_is_read_by_its_tables(self, tmp_path, names) -> None:
        write(tmp_path / "a.json", [result()])
        write(tmp_path / "c.txt", YOLO)
        write(tmp_path / "b.csv", CSV)
        found = read_predictions(tmp_path, "auto", names)
        assert (found.format, found.boxes) == ("csv", 1)


class TestReadPredictions:
    @pytest.mark.parametrize(
        ("format_", "name", "problem"),
        [
            ("coco", "x.csv", "contains no COCO results"),
            ("yolo", "x.csv", "contains no text files"),
            ("csv", "x.json", "contains no table (CSV, or MOT's .txt)"),
        ],
    )
    def test_a_file_of_another_kind_is_named_and_not_its_folder(
        self, tmp_path, names, format_, name, problem
    ) -> None:
        with pytest.raises(DatasetFormatError) as refused:
            read_predictions(write(tmp_path / name, "a,b"), format_, names)
        assert refused.value.message == f"{tmp_path / name}: {problem}"

    def test_so_is_a_document_of_another_kind(self, tmp_path, names) -> None:
        results, images = write(tmp_path / "r.json", [result()]), write(tmp_path / "i.csv", "a,b")
        with pytest.raises(DatasetFormatError) as refused:
            read_predictions(results, "coco", names, images=images)
        assert refused.value.path == str(images)


class TestCoco:
    def test_reads_boxes_with_scores_in_order(self, tmp_path, names) -> None:
        path = write(tmp_path / "r.json", [result(), result("7_1", score=1), result(score=0)])
        found = read_predictions(path, "coco", names)
        assert [item.score for item in found.detections[1]] == [0.5, 0]
        # COCO counts from the corner of the first pixel.
        assert found.detections[1][0].box == Box(9.5, 19.5, 8, 9)
        assert (found.boxes, found.report.read, found.without_score) == (3, 3, 0)

    def test_unknown_frames_are_counted_and_named(self, tmp_path, names) -> None:
        path = write(tmp_path / "r.json", [result(), result("9.png"), result("9.png")])
        found = read_predictions(path, "coco", names)
        assert found.unknown == {"9.png": 2}
        assert found.boxes == 1

    def test_numbers_mean_the_images_of_a_document_in_the_zip(self, tmp_path, names) -> None:
        images = {"images": [{"id": 5, "file_name": f"{MATCH}/7_1.png"}], "annotations": []}
        path = tmp_path / "r.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("instances_test.json", json.dumps(images))
            archive.writestr("results.json", json.dumps([result(5), result(6)]))
        found = read_predictions(path, "coco", names)
        assert list(found.detections) == [2]
        assert found.unknown == {"image 6": 1}

    def test_numbers_mean_the_images_of_a_document_beside_it(self, tmp_path, names) -> None:
        image = {"id": 5, "file_name": "7_1.png", "width": 640, "height": 360}
        images = write(tmp_path / "truth.json", {"images": [image]})
        path = write(tmp_path / "results" / "r.json", [result(5)])
        found = read_predictions(path, "coco", names, images=images)
        # Half the annotated size: the document says so.
        assert found.detections[2][0].box == Box(19.5, 39.5, 16, 18)

    def test_numbers_alone_are_never_guessed(self, tmp_path, names) -> None:
        found = read_predictions(write(tmp_path / "r.json", [result(1)]), "coco", names)
        assert found.detections == {}
        assert "document" in found.reasons["image 1"]

    @pytest.mark.parametrize(
        ("more", "field", "words"),
        [
            ({"bbox": [1, 2, 3]}, "bbox", "has 3 numbers, not 4"),
            ({"bbox": [1, 2, 0, 4]}, "bbox", "above zero"),
            ({"bbox": [5000, 2, 3, 4]}, "bbox", "outside the image of 1280 x 720"),
            ({"bbox": [1, 2, True, 4]}, "bbox", "truth value"),
            ({"bbox": [1, 2, 3e9, 4]}, "bbox", "wider or higher than the image of 1280 x 720"),
            ({"bbox": [1, 2, 3, 721]}, "bbox", "wider or higher"),
            ({"bbox": [1281, 2, 3, 4]}, "bbox", "outside the image"),
            ({"score": 1.5}, "score", "is 1.5"),
            ({"score": None}, "score", "not a number"),
            ({"image_id": None}, "image_id", "neither"),
            ({"image_id": True}, "image_id", "neither"),
        ],
    )
    def test_what_is_wrong_is_left_out_with_its_place(
        self, tmp_path, names, more, field, words
    ) -> None:
        path = write(tmp_path / "r.json", [result(), result(**more)])
        found = read_predictions(path, "coco", names)
        assert found.boxes == 1
        ((record, where, problem),) = problems(found)
        assert (record, where) == ("result 1", field)
        assert words in problem

    def test_a_record_that_is_no_object_is_left_out(self, tmp_path, names) -> None:
        found = read_predictions(write(tmp_path / "r.json", [result(), 7]), "coco", names)
        assert problems(found)[0][0] == "result 1"

    def test_boxes_of_other_classes_are_left_out_when_the_ball_is_named(
        self, tmp_path, names
    ) -> None:
        path = write(tmp_path / "r.json", [result(category_id=32), result(category_id=0)])
        found = read_predictions(path, "coco", names, category=32)
        assert (found.boxes, found.report.counts["other classes"]) == (1, 1)
        with pytest.raises(InputError, match=r"several classes \(0, 32\)"):
            read_predictions(path, "coco", names)

    def test_a_file_that_is_something_else_is_refused(self, tmp_path, names) -> None:
        for text, words in (
            ("{]", "not JSON"),
            ('{"a": 1}', 'an object with "a"; COCO results are'),
            ("[]", "no prediction"),
        ):
            with pytest.raises(InputError, match=words):
                read_predictions(write(tmp_path / "r.json", text), "coco", names)

    def test_a_missing_file_and_an_unknown_format_are_refused(self, tmp_path, names) -> None:
        with pytest.raises(InputError, match="does not exist"):
            read_predictions(tmp_path / "none.json", "coco", names)
        with pytest.raises(InputError, match='"xml" is not a format'):
            read_predictions(tmp_path / "none.json", "xml", names)

    def test_a_size_of_the_callers_scales_pixels(self, tmp_path, names) -> None:
        path = write(tmp_path / "r.json", [result()])
        found = read_predictions(path, "coco", names, size=ImageSize(2560, 1440))
        assert found.detections[1][0].box == Box(4.5, 9.5, 4, 4.5)

    @pytest.mark.parametrize("field", ["file_name", "image", "image_path"])
    def test_a_name_counts_before_a_number(self, tmp_path, names, field: str) -> None:
        numbered = {"image_id": 7, field: "7.png"}
        images = [{"id": 7, "file_name": "7_1.png"}, {"id": 1, "file_name": "7.png"}]
        document = write(tmp_path / "truth" / "t.json", {"images": images})
        path = write(tmp_path / "r.json", [result() | numbered])
        for place in (None, document):
            found = read_predictions(path, "coco", names, images=place)
            assert (list(found.detections), found.report.problems) == ([1], [])

    @pytest.mark.parametrize(
        ("identity", "words"),
        [
            (5, 'is "7.png", but image 5 of the COCO document is "7_1.png"'),
            ("7_1.png", 'is "7.png", but image_id is "7_1.png"'),
        ],
    )
    def test_a_name_that_a_number_contradicts_is_refused_with_both(
        self, tmp_path, names, identity, words: str
    ) -> None:
        document = write(
            tmp_path / "truth" / "t.json", {"images": [{"id": 5, "file_name": "7_1.png"}]}
        )
        path = write(tmp_path / "r.json", [result(), result(identity, file_name="7.png")])
        found = read_predictions(path, "coco", names, images=document)
        ((record, where, problem),) = problems(found)
        assert (record, where, found.boxes) == ("result 1", "file_name", 1)
        assert words in problem

    @pytest.mark.parametrize("identity", [5, 5.0, "5", "5.0", "005", " 5 "])
    def test_numbers_that_are_equal_are_one_image(self, tmp_path, names, identity) -> None:
        document = write(tmp_path / "t.json", {"images": [{"id": 5.0, "file_name": "7_1.png"}]})
        path = write(tmp_path / "r" / "r.json", [result(identity)])
        assert list(read_predictions(path, "coco", names, images=document).detections) == [2]

    def test_ids_that_a_document_writes_as_text_are_numbers_too(self, tmp_path, names) -> None:
        images = [{"id": "0011", "file_name": "7_1.png"}, {"id": "0012", "file_name": "7.png"}]
        document = write(tmp_path / "t" / "t.json", {"images": images})
        for identity in (11, "11.0", "011"):
            path = write(tmp_path / "r.json", [result(identity)])
            assert list(read_predictions(path, "coco", names, images=document).detections) == [2]

    @pytest.mark.parametrize(("own", "other"), [(2.0, 1.0), ("2", "1"), ("02", "01"), ("b", "p")])
    def test_ids_of_classes_are_those_of_the_document_however_they_are_written(
        self, tmp_path, names, own, other
    ) -> None:
        listed = [{"id": other, "name": "player"}, {"id": own, "name": "ball"}]
        document = write(tmp_path / "t" / "t.json", {"images": [], "categories": listed})
        numbered = [own, other] if own == "b" else [2, 1]
        for written in (numbered, [own, other]):
            results = [result(category_id=item, score=0.5) for item in written]
            path = write(tmp_path / "r.json", results)
            assert read_predictions(path, "coco", names, images=document).boxes == 1

    def test_what_a_document_cannot_mean_is_named(self, tmp_path, names) -> None:
        images = [
            {"id": 5, "file_name": "7.png"},
            {"id": "5.0", "file_name": "7_1.png"},
            {"file_name": "a.png"},
        ]
        listed = [{"id": 1, "name": "ball"}, {"name": "player"}, {"id": 1.0, "name": "player"}]
        document = write(tmp_path / "t" / "t.json", {"images": images, "categories": listed})
        path = write(tmp_path / "r.json", [result(5)])
        found = read_predictions(path, "coco", names, images=document)
        assert list(found.detections) == [1]
        assert [(record, field) for record, field, _ in problems(found)] == [
            ("image 1", "id"),
            ("image 2", "id"),
            ("category 1", "id"),
            ("category 2", "id"),
        ]

    def test_the_document_that_was_handed_over_says_what_an_id_means(self, tmp_path, names) -> None:
        other = {"images": [{"id": 5, "file_name": "7.png"}]}
        write(tmp_path / "r" / "other.json", other)
        write(tmp_path / "r" / "r.json", [result(5)])
        given = {"images": [{"id": 5, "file_name": "7_1.png"}]}
        document = write(tmp_path / "t.json", given)
        found = read_predictions(tmp_path / "r", "coco", names, images=document)
        assert list(found.detections) == [2]
        assert "is 5, which is" in problems(found)[0][2]

    def test_a_class_that_the_file_does_not_have_is_refused_with_those_that_it_has(
        self, tmp_path, names
    ) -> None:
        path = write(tmp_path / "r.json", [result(category_id=32), result(category_id=3)])
        with pytest.raises(
            InputError, match="contains no class 0; its classes are 3, 32"
        ) as refused:
            read_predictions(path, "coco", names, category=0)
        assert refused.value.pointer == "/category"

    def test_the_class_that_a_document_calls_ball_is_the_ball(self, tmp_path, names) -> None:
        document = {
            "images": [{"id": 5, "file_name": "7.png"}],
            "categories": [{"id": 1, "name": "player"}, {"id": 2, "name": "sports_ball"}],
        }
        images = write(tmp_path / "t" / "t.json", document)
        path = write(
            tmp_path / "r.json", [result(5, category_id=1), result(5, category_id=2, score=1)]
        )
        found = read_predictions(path, "coco", names, images=images)
        assert [item.score for item in found.detections[1]] == [1]
        path.write_text(json.dumps([result(5, category_id=1)]))
        with pytest.raises(InputError, match=r"no class called ball; its classes are 1 \(player\)"):
            read_predictions(path, "coco", names, images=images)

    @pytest.mark.parametrize("name", ["ballon", "pelota", "sportsball", "footballs", "ball_1"])
    def test_the_ball_of_predictions_has_the_names_that_it_has_in_datasets(
        self, tmp_path, names, name: str
    ) -> None:
        other = ("ball boy", "ball_carrier", "basket ball", "tennis ball", "Balloon")
        listed = [{"id": at, "name": text} for at, text in enumerate((*other, name))]
        images = write(tmp_path / "t" / "t.json", {"images": [], "categories": listed})
        results = [result(category_id=at, score=at / 10) for at in range(len(listed))]
        path = write(tmp_path / "r.json", results)
        found = read_predictions(path, "coco", names, images=images)
        assert [item.score for item in found.detections[1]] == [0.5]
        rows = "".join(f"7.png,1,2,8,9,{text}\n" for text in (*other, name))
        path = write(tmp_path / "r.csv", f"image,x,y,w,h,class\n{rows}")
        assert read_predictions(path, "csv", names).boxes == 1

    def test_a_number_that_is_none_costs_its_own_result_alone(self, tmp_path, names) -> None:
        text = json.dumps([result(), result(score=0.25)]).replace("0.25", "NaN")
        found = read_predictions(write(tmp_path / "r.json", text), "coco", names)
        assert (found.boxes, problems(found)[0][:2]) == (1, ("result 1", "score"))

    def test_json_lines_are_read(self, tmp_path, names) -> None:
        text = "\n".join(map(json.dumps, [result(), result("7_1.png")]))
        assert read_predictions(write(tmp_path / "r.json", text), "coco", names).boxes == 2

    def test_a_line_that_cannot_be_read_is_named_and_the_others_are_read(
        self, tmp_path, names
    ) -> None:
        good = json.dumps(result())
        path = write(tmp_path / "r.jsonl", f"{good}\n{good[:-20]}\n{good}\n")
        found = read_predictions(path, "coco", names)
        assert (found.boxes, [record for record, _, _ in problems(found)]) == (2, ["line 2"])


class TestYolo:
    def test_the_id_of_a_track_is_no_confidence(self, tmp_path, names) -> None:
        write(tmp_path / "7.txt", "0 0.5 0.5 0.01 0.02 1\n0 0.25 0.5 0.01 0.02 17\n")
        found = read_predictions(tmp_path, "yolo", names)
        assert ([item.score for item in found.detections[1]], found.without_score) == ([1, 1], 2)
        assert "id of a track" in problems(found)[0][2]

    @pytest.mark.parametrize("last", ["²", "9" * 5000, "٣"])
    def test_a_last_number_that_is_none_is_named(self, tmp_path, names, last: str) -> None:
        path = write(tmp_path / "7.txt", f"0 0.5 0.5 0.01 0.01 0.5\n0 0.5 0.5 0.01 0.01 {last}\n")
        found = read_predictions(path, "yolo", names)
        assert (found.boxes, [record for record, _, _ in problems(found)]) == (1, ["line 2"])
        write(path, f"0 0.5 0.5 0.01 0.01 {last}\n")
        with pytest.raises(DatasetFormatError, match="line 1"):
            read_predictions(path, "yolo", names)

    def test_a_confidence_may_stand_before_the_id_of_a_track(self, tmp_path, names) -> None:
        write(tmp_path / "7.txt", "0 0.5 0.5 0.01 0.02 0.75 17\n")
        found = read_predictions(tmp_path, "yolo", names)
        assert ([item.score for item in found.detections[1]], found.without_score) == ([0.75], 0)

    def test_a_class_that_the_files_do_not_have_is_refused(self, tmp_path, names) -> None:
        write(tmp_path / "7.txt", YOLO)
        with pytest.raises(InputError, match="contains no class 32; its classes are 0"):
            read_predictions(tmp_path, "yolo", names, category=32)

    def test_a_size_and_a_document_are_refused(self, tmp_path, names) -> None:
        write(tmp_path / "7.txt", YOLO)
        with pytest.raises(InputError, match="yolo do not use an image size"):
            read_predictions(tmp_path, "auto", names, size=SIZE)
        with pytest.raises(InputError, match="yolo do not use a COCO document"):
            read_predictions(tmp_path, "auto", names, images=tmp_path / "x.json")

    def test_reads_shares_of_the_image(self, tmp_path, names) -> None:
        write(tmp_path / "labels" / "7.txt", "0 0.5 0.5 0.01 0.02 0.75\n\n0 0.25 0.5 0.01 0.02\n")
        write(tmp_path / "labels" / "7_1.txt", "")
        write(tmp_path / "classes.txt", "ball")
        found = read_predictions(tmp_path, "yolo", names)
        first, second = found.detections[1]
        # Half of 1280 x 720 from the corner is between the pixels 639 and 640.
        assert first.box.center == (639.5, 359.5)
        assert (first.box.width, first.box.height) == pytest.approx((12.8, 14.4))
        assert (first.score, second.score, found.without_score) == (0.75, 1, 1)

    def test_reads_a_zip_and_counts_unknown_files(self, tmp_path, names) -> None:
        path = tmp_path / "y.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("out/cam3_358.txt", "0 0.5 0.5 0.01 0.02 0.75\n")
            archive.writestr("out/cam3_999.txt", "0 0.5 0.5 0.01 0.02 0.75\n" * 3)
        found = read_predictions(path, "yolo", names)
        assert list(found.detections) == [9]
        assert found.unknown == {"out/cam3_999.txt": 3}

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ("0 0.5 0.5 0.01", "has 4 numbers"),
            ("0 640 360 12 14 0.5", "in pixels"),
            ("0 0.5 0.5 x 0.1", '"x"'),
            ("0.5 0.5 0.5 0.1 0.1", "whole number"),
            ("0 0.5 0.5 0 0.1", "above zero"),
            ("0 0.5 0.5 1.5 0.1", "wider or higher than the image"),
            ("0 0.5 0.5 0.1 0.1 2", "is 2, which"),
        ],
    )
    def test_what_is_wrong_is_left_out_with_its_line(self, tmp_path, names, line, words) -> None:
        write(tmp_path / "7.txt", f"0 0.5 0.5 0.01 0.02 0.5\n{line}\n")
        found = read_predictions(tmp_path, "yolo", names)
        ((record, _field, problem),) = problems(found)
        assert record == "line 2"
        assert words in problem
        assert found.boxes == 1


class TestCsv:
    @pytest.mark.parametrize("text", ["", "\n\n", "frame,x,y,w,h,score\n", "\ufeff"])
    def test_a_table_without_a_row_is_no_evaluation_of_nothing(
        self, tmp_path, names, text: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=r"r\.csv: contains no rows"):
            read_predictions(write(tmp_path / "r.csv", text), "csv", names)

    def test_reads_a_table_like_snv3d(self, tmp_path, names) -> None:
        league, season, match = MATCH.split("/")
        head = ",league,season,match,main_action,replay,img_w,img_h,ball_bbox,score"
        row = f"{league},{season},{match},7"
        text = (
            f'{head}\n0,{row},,640,360,"[10, 20, 8, 9]",0.5\n'
            f'1,{row},1.0,1280,720,"[10.0, 20.0, 8.0, 9.0]",\n2,{row},,640,360,,\n'
        )
        found = read_predictions(write(tmp_path / "p.csv", text), "csv", names)
        assert found.detections[1][0].box == Box(20.5, 40.5, 16, 18)
        assert found.detections[2][0].box == Box(10, 20, 8, 9)
        assert (found.boxes, found.without_score) == (2, 1)

    @pytest.mark.parametrize(
        "text",
        [
            "camera,frame,x,y,w,h\n3.0,358.0,10,20,8,9\n",
            "camera,frame,x,y,w,h\ncam3,358.00,10,20,8,9\n",
            "frame,x,y,w,h\n358.00,10,20,8,9\n",
        ],
    )
    def test_a_number_with_a_point_is_that_number(self, tmp_path, names, text: str) -> None:
        found = read_predictions(write(tmp_path / "p.csv", text), "csv", names)
        assert list(found.detections) == [9]

    def test_reads_cameras_and_frames(self, tmp_path, names) -> None:
        text = "camera,frame,x,y,w,h,confidence\n3,358,10,20,8,9,0.25\ncam3,358.0,1,2,3,4,0.5\n"
        found = read_predictions(write(tmp_path / "p.csv", text), "csv", names)
        assert [item.score for item in found.detections[9]] == [0.25, 0.5]

    def test_reads_names_of_images(self, tmp_path, names) -> None:
        text = "image,x,y,width,height,score\n7_1.png,10,20,8,9,0.25\n"
        assert 2 in read_predictions(write(tmp_path / "p.csv", text), "csv", names).detections

    @pytest.mark.parametrize(
        "text",
        [
            "Image,X,Y,W,H,Score\n7.png,10,20,8,9,0.5\n",
            "image;x;y;w;h;score\n7.png;10;20;8;9;0.5\n",
            "image;x;y;w;h;score\n7.png;10,0;20,00;8,0;9,0;0,5\n",
            "image\tx\ty\tw\th\tconf\n7.png\t10\t20\t8\t9\t0.5\n",
            "file name,Left,Top,Width,Height,Probability\n7.png,10,20,8,9,0.5\n",
            "image,xmin,ymin,xmax,ymax,confidence,class,name\n7.png,10,20,18,29,0.5,32,sports ball\n",
            "image,x1,y1,x2,y2,score\n7.png,10,20,18,29,0.5\n",
            "image,cx,cy,w,h,score\n7.png,14,24.5,8,9,0.5\n",
            "filename,X Center,Y Center,width,height,score\n7.png,14,24.5,8,9,0.5\n",
            'image,bbox,score\n7.png,"[10, 20, 8, 9]",0.5\n',
            "image,frame,x,y,w,h,score\n7.png,831,10,20,8,9,0.5\n",
            "frame,x,y,w,h,score\n7,10,20,8,9,0.5\n",
            "image,class,x,y,w,h,score\n7.png,person,1,2,8,9,0.5\n7.png,ball,10,20,8,9,0.5\n",
        ],
    )
    def test_reads_the_columns_of_many_tools(self, tmp_path, names, text: str) -> None:
        found = read_predictions(write(tmp_path / "p.csv", text), "auto", names)
        ((detection,),) = found.detections.values()
        assert (list(found.detections), detection.box) == ([1], Box(10, 20, 8, 9))
        assert (detection.score, found.report.problems) == (0.5, [])

    @pytest.mark.parametrize("ending", ["txt", "csv"])
    def test_reads_the_files_of_mot(self, tmp_path, names, ending: str) -> None:
        text = "7,-1,10,20,8,9,0.5,-1,-1,-1\n7,-1,30,20,8,9,-1,-1,-1,-1\n"
        found = read_predictions(write(tmp_path / f"gt.{ending}", text), "auto", names)
        assert [item.box.x for item in found.detections[1]] == [10, 30]
        assert (found.format, found.without_score) == ("csv", 1)

    def test_reads_the_sequences_of_mot_each_by_its_folder(self, tmp_path: Path) -> None:
        frames = [
            NamedFrame(n, f"SNMOT-{n}/00000{n}.jpg", "000001.jpg", f"SNMOT-{n}", SIZE)
            for n in (1, 2)
        ]
        for n in (1, 2):
            folder = tmp_path / f"test/SNMOT-{n}"
            rows = f"1,1,10,20,8,9,1,-1,-1,-1\n1,{n + 1},{n}00,20,8,9,1,-1,-1,-1\n"
            write(folder / "gt/gt.txt", rows)
            write(
                folder / "gameinfo.ini",
                f"[Sequence]\ntrackletID_1= player team left;10\ntrackletID_{n + 1}= ball;1\n",
            )
        found = read_predictions(tmp_path, "auto", FrameNameIndex.of(frames))
        assert [found.detections[n][0].box.x for n in (1, 2)] == [100, 200]
        assert (found.boxes, found.report.counts["other classes"]) == (2, 2)

    def test_tracks_of_mot_need_to_say_which_is_the_ball(self, tmp_path: Path, names) -> None:
        text = "7,1,10,20,8,9,0.5,-1,-1,-1\n7,2,30,20,8,9,0.5,-1,-1,-1\n"
        path = write(tmp_path / "gt.txt", text)
        with pytest.raises(InputError, match="does not say which of them is the ball"):
            read_predictions(path, "auto", names)
        found = read_predictions(path, "auto", names, category=2)
        assert [item.box.x for item in found.detections[1]] == [30]

    @pytest.mark.parametrize("place", ["gameinfo.ini", "gt/gameinfo.ini"])
    @pytest.mark.parametrize("given", ["", "gt", "gt/gt.txt"])
    def test_the_game_of_mot_lies_beside_the_table_or_its_folder(
        self, tmp_path: Path, names, place: str, given: str
    ) -> None:
        rows = "7,1,10,20,8,9,0.5,-1,-1,-1\n7,2,30,20,8,9,0.5,-1,-1,-1\n"
        write(tmp_path / "gt/gt.txt", rows)
        write(tmp_path / place, "trackletID_1= player\ntrackletID_2= ball;1\n")
        found = read_predictions(tmp_path / given, "auto", names)
        assert [item.box.x for item in found.detections[1]] == [30]

    def test_a_track_of_mot_is_the_ball_also_where_frames_have_one_track(
        self, tmp_path: Path
    ) -> None:
        frames = [NamedFrame(n, f"S-{n}/1.jpg", "0001.jpg", f"S-{n}", SIZE) for n in (1, 2)]
        write(tmp_path / "S-1/gt/gt.txt", "1,1,10,20,8,9,1,-1\n1,7,100,20,8,9,1,-1\n")
        write(tmp_path / "S-2/gt/gt.txt", "1,7,200,20,8,9,1,-1\n")
        found = read_predictions(tmp_path, "auto", FrameNameIndex.of(frames), category=7)
        assert [found.detections[n][0].box.x for n in (1, 2)] == [100, 200]

    def test_sequences_of_mot_that_the_dataset_does_not_tell_apart_are_unknown(
        self, tmp_path: Path
    ) -> None:
        frames = [NamedFrame(n, f"{n:06}.jpg", f"{n:06}.jpg", "", SIZE) for n in (1, 2)]
        index = FrameNameIndex.of(frames)
        for n in (1, 2):
            write(tmp_path / f"S-{n}/det/det.txt", f"{n},-1,{n}00,20,8,9,0.9,-1\n")
        found = read_predictions(tmp_path, "auto", index)
        assert (found.boxes, found.unknown.total()) == (0, 2)
        assert read_predictions(tmp_path / "S-2", "auto", index).boxes == 1

    def test_frames_that_several_folders_mean_are_unknown(self, tmp_path: Path) -> None:
        frames = [
            NamedFrame(n, f"{n}.jpg", f"{n}.jpg", "", SIZE, path=f"/d/S-1/img1/{n}.jpg")
            for n in (1, 2)
        ]
        index = FrameNameIndex.of(frames)
        rows = "".join(
            f"{name},10,20,8,9\n"
            for name in ("/d/S-1/img1/1.jpg", "/d/S-2/img1/1.jpg", "/d/S-1/img1/2.jpg")
        )
        found = read_predictions(write(tmp_path / "a.csv", f"image,x,y,w,h\n{rows}"), "auto", index)
        assert [*found.detections] == [2]
        assert found.unknown == {"/d/S-1/img1/1.jpg, /d/S-2/img1/1.jpg": 2}
        assert "several sequences mean this frame" in next(iter(found.reasons.values()))
        for n in (1, 2):
            write(tmp_path / f"y/S-{n}/labels/1.txt", YOLO)
        assert read_predictions(tmp_path / "y", "auto", index).boxes == 0

    def test_several_tables_are_named(self, tmp_path: Path, names) -> None:
        for name in ("a.csv", "b.csv"):
            write(tmp_path / name, CSV)
        with pytest.raises(DatasetFormatError, match=r"contains 2 tables \(a.csv, b.csv\)"):
            read_predictions(tmp_path, "auto", names)
        for name in ("x/gt/gt.txt", "x/det/det.txt"):
            write(tmp_path / "mot" / name, "7,1,10,20,8,9,0.5,-1,-1,-1\n")
        with pytest.raises(DatasetFormatError, match="several MOT tables of one sequence"):
            read_predictions(tmp_path / "mot", "auto", names)

    @pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
    def test_reads_what_excel_writes(self, tmp_path: Path, names, encoding: str) -> None:
        path = tmp_path / "p.csv"
        path.write_text("sep=;\nimage;x;y;w;h\n7.png;10,5;20;8;9\n7.png;a;0;1;1\n", encoding)
        found = read_predictions(path, "auto", names)
        assert found.detections[1][0].box.x == 10.5
        assert [record for record, *_ in problems(found)] == ["line 4"]

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (
                "Frame,Visibility,X,Y\n7,1,641,318\n",
                'columns "frame", "visibility", "x", "y"; x and y',
            ),
            ("image,score\n7.png,0.5\n", 'columns "image", "score"; a table of predictions'),
            ("x,y,w,h\n1,2,3,4\n", 'columns "x", "y", "w", "h"; a table of predictions'),
        ],
    )
    def test_a_table_without_frame_or_box_is_one_sentence(
        self, tmp_path, names, text: str, words: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=words) as refused:
            read_predictions(write(tmp_path / "p.csv", text), "csv", names)
        assert refused.value.record is None

    def test_shares_of_the_image_are_no_pixels(self, tmp_path, names) -> None:
        text = "image,x,y,w,h\n7.png,0.5,0.5,0.01,0.01\n7.png,0.5,0.5,0.1,0.1\n7.png,300,3,3,3\n"
        with pytest.raises(InputError, match="within 2 pixels of the corner"):
            read_predictions(write(tmp_path / "p.csv", text), "csv", names)

    @pytest.mark.parametrize(
        ("text", "field", "words"),
        [
            ("image,x,y,w,h\n7.png,1,2,a,4\n", "w", '"a"'),
            ("image,x,y,w,h\n7.png,1,2,3e9,4\n", "x, y, w, h", "wider or higher"),
            ('image,ball_bbox\n7.png,"[1, 2, 3, 4e9]"\n', "ball_bbox", "wider or higher"),
            ("image,x,y,w,h\n,1,2,3,4\n", "frame", "missing"),
            ('image,ball_bbox\n7.png,"[1, 2, __import__(3), 4]"\n', "ball_bbox", "not a list"),
        ],
    )
    def test_what_is_wrong_is_named(self, tmp_path, names, text, field, words) -> None:
        good = write(tmp_path / "p.csv", text)
        with pytest.raises(DatasetFormatError, match=words) as caught:
            read_predictions(good, "csv", names)
        assert (caught.value.record, caught.value.field) == ("line 2", field)


class TestPredictedCameras:
    def test_belong_to_frames_by_name_and_to_all_of_a_static_camera(self, tmp_path, names) -> None:
        camera = camera_at(50.0)
        text = json.dumps(camera_to_json(camera))
        write(tmp_path / MATCH / "camera_7.json", text)
        write(tmp_path / "camera_cam3.json", text)
        write(tmp_path / "camera_44.json", text)
        found = read_predicted_cameras(tmp_path, names)
        assert set(found.cameras) == {1, 9}
        assert found.cameras[1].focal_length == camera.focal_length
        assert list(found.unknown) == ["44"]

    def test_are_scaled_from_their_own_size(self, tmp_path, names) -> None:
        write(
            tmp_path / "camera_7.json", json.dumps(camera_to_json(camera_at(50.0).scaled(0.5, 0.5)))
        )
        found = read_predicted_cameras(tmp_path, names, size=ImageSize(640, 360))
        assert found.cameras[1].focal_length == pytest.approx((2000, 2000))
        assert found.cameras[1].principal_point == pytest.approx((639.5, 359.5))

    def test_of_another_size_are_told(self, tmp_path, names) -> None:
        camera = replace(camera_at(50.0), principal_point=(479.5, 269.5))
        write(tmp_path / "camera_7.json", json.dumps(camera_to_json(camera)))
        ((record, _, problem),) = problems(read_predicted_cameras(tmp_path, names))
        assert (record, "--cameras-size 960x540" in problem) == ("7", True)

    def test_without_any_it_is_refused(self, tmp_path, names) -> None:
        with pytest.raises(InputError, match="no camera files"):
            read_predicted_cameras(tmp_path, names)
