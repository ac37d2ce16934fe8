import json
import math
import unicodedata
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from app.errors import DatasetFormatError, InputError
from app.features.file_tools.calibrate import calibrate_files, score_camera_files
from app.features.file_tools.matches import estimate_pitch_of_files
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_writer import write_line_files
from app.soccer.annotation import make_lines
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, MAIN, OPPOSITE, click


def write(folder, **frames):
    folder.mkdir(parents=True, exist_ok=True)
    write_line_files(folder, [LineFile(stem, SIZE, lines) for stem, lines in frames.items()])
    return folder


def run(source, out, **options):
    with ThreadPoolExecutor(1) as executor:
        return calibrate_files(source, out, size=SIZE, executor=executor, **options)


@pytest.fixture
def lines(tmp_path):
    swapped = dict(click(MAIN, 0.5))
    swapped["Circle left"] = swapped.pop("Circle right")
    few = {"Circle right": click(MAIN)["Circle right"]}
    return write(
        tmp_path / "lines",
        good=click(BEHIND_GOAL, 0.5),
        other=click(OPPOSITE, 0.5),
        swapped=make_lines(swapped),
        few=make_lines(few),
    )


class TestCalibrateFiles:
    def test_every_frame_with_enough_lines_gets_a_camera_file(self, lines, tmp_path):
        summary = run(lines, tmp_path / "out")
        assert (summary["frames"], summary["calibrated"]) == (4, 3)
        assert [item["frame"] for item in summary["failed"]] == ["few"]
        assert "a camera needs 7" in summary["failed"][0]["reason"]
        assert sorted(path.name for path in (tmp_path / "out").glob("camera_*")) == [
            "camera_good.json",
            "camera_other.json",
            "camera_swapped.json",
        ]
        assert json.loads((tmp_path / "out" / "calibrate.json").read_text()) == summary
        camera = json.loads((tmp_path / "out" / "camera_good.json").read_text())
        sigma = np.sqrt(np.diag(camera["covariance"]))
        apart = np.subtract(camera["position_meters"], BEHIND_GOAL.position)
        assert (np.abs(apart) < 4 * sigma[:3]).all() and sigma[:3].max() < 2

    def test_lines_by_the_laws_are_fitted_where_asked_for(self, tmp_path):
        lines = write(tmp_path / "lines", a=click(MAIN, pitch=Pitch(goal="laws")))
        off = {}
        for goal in ("middle", "laws"):
            run(lines, tmp_path / goal, goal=goal)
            camera = json.loads((tmp_path / goal / "camera_a.json").read_text())
            off[goal] = math.dist(camera["position_meters"], MAIN.position)
        assert 3 * off["laws"] < off["middle"], off

    def test_findings_name_the_frame_and_the_marking(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        findings = json.loads((tmp_path / "out" / "findings.json").read_text())
        (wrong,) = [item for item in findings if item["kind"] == "wrong_label"]
        assert (wrong["frame"], wrong["marking"], wrong["suggested"]) == (
            "swapped",
            "Circle left",
            "Circle right",
        )

    def test_a_frame_that_shows_another_pitch_says_so(self, tmp_path):
        camera = looking((3.0, 66.0, -18.0), (24.0, -2.0, 0.0), 1500.0, bend=BEND)
        frames = {"short": Pitch(98.0, 64.0), "usual": Pitch()}
        lines = {stem: click(camera, 1.0, 3, pitch) for stem, pitch in frames.items()}
        run(write(tmp_path / "lines", **lines), tmp_path / "out")
        findings = json.loads((tmp_path / "out" / "findings.json").read_text())
        (told,) = [item for item in findings if item["kind"] == "pitch_size"]
        assert told["frame"] == "short"
        assert told["number"] > told["threshold"]

    def test_labels_taken_as_given_are_not_doubted(self, lines, tmp_path):
        run(lines, tmp_path / "out", labels="given")
        findings = json.loads((tmp_path / "out" / "findings.json").read_text())
        assert "wrong_label" not in {item["kind"] for item in findings}

    def test_each_marking_is_left_out_in_turn_when_asked(self, lines, tmp_path):
        run(lines, tmp_path / "out", with_leave_one_out=True)
        rows = json.loads((tmp_path / "out" / "leave_one_out.json").read_text())
        marked = {row["marking"] for row in rows if row["frame"] == "good"}
        assert marked == set(click(BEHIND_GOAL))

    def test_cameras_of_an_earlier_run_do_not_stay(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        (lines / "other.json").unlink()
        run(lines, tmp_path / "out")
        assert not (tmp_path / "out" / "camera_other.json").exists()

    def test_foreign_files_in_the_folder_stay(self, lines, tmp_path):
        foreign = tmp_path / "out" / "camera_mine.json"
        foreign.parent.mkdir()
        foreign.write_text("{}")
        run(lines, tmp_path / "out")
        assert foreign.read_text() == "{}"

    def test_a_broken_file_is_named_and_the_rest_is_done(self, lines, tmp_path):
        (lines / "broken.json").write_text('{"Middle line": [')
        summary = run(lines, tmp_path / "out")
        assert summary["calibrated"] == 3
        assert "broken" in {item["frame"] for item in summary["failed"]}
        assert "broken.json" in summary["problems"][0]

    def test_a_camera_is_that_of_its_lines_however_accents_are_composed(self, tmp_path):
        lines = write(tmp_path / "lines", **{unicodedata.normalize("NFC", "Köln"): click(MAIN)})
        run(lines, tmp_path / "out")
        (camera,) = (tmp_path / "out").glob("camera_*.json")
        camera.rename(camera.with_name(unicodedata.normalize("NFD", camera.name)))
        assert score_camera_files(lines, tmp_path / "out", size=SIZE)["completeness"] == 1.0

    def test_a_bad_point_fails_no_frame(self, tmp_path):
        source = tmp_path / "lines"
        write(source / "train", same=click(MAIN, 0.5))
        write(source / "valid", same=click(OPPOSITE, 0.5))
        file = source / "train/same.json"
        value = json.loads(file.read_text())
        value["Middle line"] = [*value.get("Middle line", []), {"x": "left", "y": 0.5}]
        file.write_text(json.dumps(value))
        (source / "valid/same.json").write_text("{")
        summary = run(source, tmp_path / "out")
        assert [item["frame"] for item in summary["failed"]] == ["valid/same"]
        assert len(summary["problems"]) == 2

    def test_images_of_one_file_are_named_in_problems_and_failures(self, tmp_path):
        source = write(tmp_path / "lines", a=click(MAIN, 0.5), b=click(OPPOSITE, 0.5))
        images = {}
        for stem in ("a", "b"):
            images[f"{stem}.jpg"] = json.loads((source / f"{stem}.json").read_text())
            (source / f"{stem}.json").unlink()
        images["a.jpg"]["Middle line"] = [{"x": "left", "y": 0.5}]
        images["c.jpg"] = {"keypoints": [1, 2, 3]}
        (source / "all.json").write_text(json.dumps(images))
        summary = run(source, tmp_path / "out")
        assert [item["frame"] for item in summary["failed"]] == ["c"]
        assert summary["frames"] == summary["calibrated"] + len(summary["failed"])
        assert any("all.json, a, Middle line" in problem for problem in summary["problems"])

    def test_frames_of_the_same_name_stay_in_their_folders(self, tmp_path):
        source = tmp_path / "lines"
        write(source / "train", same=click(MAIN, 0.5))
        write(source / "valid", same=click(OPPOSITE, 0.5))
        assert run(source, tmp_path / "out")["calibrated"] == 2
        assert (tmp_path / "out" / "train" / "camera_same.json").is_file()
        assert score_camera_files(source, tmp_path / "out", size=SIZE)["calibrated"] == 2
        (source / "valid" / "same.json").unlink()
        run(source, tmp_path / "out")
        assert not (tmp_path / "out" / "valid" / "camera_same.json").exists()

    def test_a_folder_without_line_files_is_refused(self, tmp_path):
        (tmp_path / "empty").mkdir()
        with pytest.raises(InputError, match="contains no line files"):
            run(tmp_path / "empty", tmp_path / "out")
        assert not (tmp_path / "out").exists()


@pytest.fixture
def match(tmp_path):
    """Seven frames of one main camera, the last with few markings, and a replay."""
    frames = {}
    for number, x in enumerate((-38.0, -30.0, 28.0, 32.0, 36.0, 40.0)):
        camera = looking((1.0, 60.0, -14.0), (x, -2.0, 0.0), 1700.0, bend=BEND)
        frames[f"0{number}"] = click(camera, 1.0, number)
    near = click(looking((1.0, 60.0, -14.0), (38.0, -2.0, 0.0), 3200.0, bend=BEND), 1.0, 3)
    few = ("Big rect. right main", "Big rect. right top", "Circle right", "Small rect. right main")
    frames["06"] = make_lines({name: near[name] for name in few})
    return write(tmp_path / "match", **frames, replay=click(BEHIND_GOAL, 0.5))


def place(out, stem):
    return json.loads((out / f"camera_{stem}.json").read_text())["position_meters"]


class TestMatches:
    @pytest.mark.parametrize("ending", ["json", "csv"])
    def test_frames_of_a_named_match_share_the_position(self, match, tmp_path, ending):
        named = {f"0{number}": "cup" for number in range(7)} | {"replay": "cup"}
        file = tmp_path / f"matches.{ending}"
        rows = "".join(f"{frame},{name}\n" for frame, name in named.items())
        file.write_text(json.dumps(named) if ending == "json" else f"frame,match\n{rows}")
        run(match, tmp_path / "alone")
        summary = run(match, tmp_path / "shared", matches=file)
        assert (summary["calibrated"], summary["matches"]) == (8, 1)
        far = [math.dist(place(tmp_path / out, "06"), (1, 60, -14)) for out in ("alone", "shared")]
        assert far[1] < min(1.0, far[0])
        assert place(tmp_path / "shared", "replay") == place(tmp_path / "alone", "replay")

    def test_matches_are_guessed_where_nobody_names_them(self, match, tmp_path):
        summary = run(match, tmp_path / "out", guess=True, with_leave_one_out=True)
        assert summary["matches"] == 1
        assert math.dist(place(tmp_path / "out", "06"), (1, 60, -14)) < 1.0
        rows = json.loads((tmp_path / "out" / "leave_one_out.json").read_text())
        assert {row["frame"] for row in rows} == {*(f"0{number}" for number in range(7)), "replay"}

    def test_frames_that_nobody_names_are_alone(self, match, tmp_path):
        file = tmp_path / "matches.json"
        file.write_text(json.dumps({"replay": "cup", "06": ""}))
        run(match, tmp_path / "alone")
        summary = run(match, tmp_path / "shared", matches=file)
        assert summary["matches"] == 1
        for stem in ("00", "06"):
            assert place(tmp_path / "shared", stem) == place(tmp_path / "alone", stem)

    @pytest.mark.parametrize("text", ["{}", '{"other": "cup"}', '{"00": ""}'])
    def test_a_file_that_names_no_frame_is_refused(self, match, tmp_path, text):
        file = tmp_path / "matches.json"
        file.write_text(text)
        with pytest.raises(InputError, match=r"matches\.json names none of the 8 frames, such as "):
            run(match, tmp_path / "out", matches=file)

    def test_rows_without_a_match_are_named(self, lines, tmp_path):
        file = tmp_path / "matches.csv"
        stem = sorted(path.stem for path in lines.glob("*.json"))[0]
        file.write_text(f"frame,match\n{stem},cup\nx\ny,\n")
        problems = run(lines, tmp_path / "out", matches=file)["problems"]
        assert [f"line {line}, match" in "; ".join(problems) for line in (3, 4)] == [True, True]

    def test_a_file_of_something_else_is_named(self, match, tmp_path):
        file = tmp_path / "matches.csv"
        file.write_text("a,b\n1,2\n")
        with pytest.raises(DatasetFormatError, match="frame"):
            run(match, tmp_path / "out", matches=file)


class TestScoreFiles:
    def test_a_frame_without_a_camera_counts_as_zero(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        total = score_camera_files(lines, tmp_path / "out", size=SIZE)
        assert (total["frames"], total["calibrated"], total["completeness"]) == (4, 3, 0.75)
        assert 0.6 < total["jac_0.5"] <= 0.75
        assert total["ms_median"] > 0

    def test_markings_called_mislabelled_can_be_left_out(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        plain = score_camera_files(lines, tmp_path / "out", size=SIZE)
        without = score_camera_files(
            lines, tmp_path / "out", size=SIZE, without=tmp_path / "out" / "findings.json"
        )
        assert without["jac_0.5"] > plain["jac_0.5"]

    def test_cameras_that_belong_to_no_frame_are_no_score(self, lines, tmp_path):
        (tmp_path / "cameras").mkdir()
        run(lines, tmp_path / "out")
        for file in (tmp_path / "out").glob("camera_*.json"):
            file.rename(tmp_path / "cameras" / f"camera_other_{file.stem}.json")
        with pytest.raises(
            InputError,
            match="no camera file has the frame name of a line file: there is a camera of",
        ):
            score_camera_files(lines, tmp_path / "cameras", size=SIZE)

    def test_cameras_of_others_have_no_times(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        (tmp_path / "out" / "calibrate.json").unlink()
        assert score_camera_files(lines, tmp_path / "out", size=SIZE)["ms_median"] is None

    def test_a_line_file_that_cannot_be_read_counts_as_a_frame(self, lines, tmp_path):
        run(lines, tmp_path / "out")
        (lines / "broken.json").write_text("[")
        total = score_camera_files(lines, tmp_path / "out", size=SIZE)
        assert (total["frames"], len(total["problems"])) == (5, 1)

    def test_a_folder_without_cameras_is_refused(self, lines, tmp_path):
        (tmp_path / "empty").mkdir()
        with pytest.raises(InputError, match="contains no camera files"):
            score_camera_files(lines, tmp_path / "empty", size=SIZE)

    @pytest.mark.parametrize("text", ["[1]", '{"ms_median": "fast"}'])
    def test_times_that_are_no_numbers_are_passed_over(self, lines, tmp_path, text):
        run(lines, tmp_path / "out")
        (tmp_path / "out" / "calibrate.json").write_text(text)
        assert score_camera_files(lines, tmp_path / "out", size=SIZE)["ms_median"] is None


class TestEstimatePitchOfFiles:
    def test_frames_of_one_match_tell_their_pitch(self, tmp_path):
        true = Pitch(102.0, 66.0)
        frames = {
            f"{index}": click(
                looking((0.0, 62.0, -16.0), (-36.0 + 12.0 * index, -4.0, 0.0), 1300.0, bend=BEND),
                0.6,
                index,
                true,
            )
            for index in range(7)
        }
        found = estimate_pitch_of_files(write(tmp_path / "lines", **frames), size=SIZE)
        assert found["length_m"] == pytest.approx(102.0, abs=0.6)
        assert found["width_m"] == pytest.approx(66.0, abs=0.6)
