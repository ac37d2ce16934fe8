"""The paper's pattern, on a small sample: what ``make paper`` writes down at length."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.pitch import Pitch
from app.solving.jaccard import camera_jaccard, project_markings
from tests.cameras import looking
from tests.paper.page import page
from tests.paper.printed_jac import printed_jaccard
from tests.paper.study import Study, run_study


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    store = Store.open(Settings(home=tmp_path_factory.mktemp("study")))
    found = run_study(store, groups=16, seed=5, faults=False)
    store.close()
    return found


def value(evaluation, table: str, row: str, column: str) -> float:
    return evaluation.table(table).cell(row, column).value


class TestPattern:
    def test_optimised_boxes_beat_loose_ones_against_the_truth(self, study) -> None:
        boxes = study.opt.table("boxes")
        assert boxes.cell("optimized", "iou").value > boxes.cell("annotated", "iou").value + 0.05
        assert (
            boxes.cell("optimized", "size_error_percent").value
            < boxes.cell("annotated", "size_error_percent").value / 2
        )

    def test_the_ball_is_placed_far_better_from_optimised_boxes(self, study) -> None:
        for cameras in ("oracle", "predicted"):
            base, opt = (
                {name: value(run, "localization", cameras, name) for name in ("mae_m", "p_2m")}
                for run in (study.base, study.opt)
            )
            assert opt["mae_m"] < base["mae_m"] / 2
            assert opt["p_2m"] > 3 * base["p_2m"]

    def test_both_detectors_find_the_same_balls(self, study) -> None:
        assert study.base.counts["detections"] == study.opt.counts["detections"]
        assert study.looseness[0] == pytest.approx(1.24, abs=0.05)
        assert study.looseness[1] == pytest.approx(1.0, abs=0.03)

    def test_sensitivity_grows_with_distance(self, study) -> None:
        assert value(study.opt, "sensitivity", "size", "correlation") > 0.99
        assert value(study.opt, "sensitivity", "size", "median_m") > 4
        assert value(study.opt, "sensitivity", "shift", "median_m") < 2


class TestPage:
    def test_says_that_the_detector_is_simulated(self, study) -> None:
        text = page(study)
        assert "There is no detector here" in text
        assert "nan" not in text.lower().split()

    def test_the_committed_page_has_the_same_parts(self, study) -> None:
        committed = Path(__file__).parents[2] / "docs" / "reproduction.md"
        heads = [line for line in page(study).splitlines() if line.startswith("#")]
        written = committed.read_text(encoding="utf-8").splitlines()
        assert [line for line in written if line.startswith("#")] == heads

    def test_says_where_real_files_were_missing(self, study) -> None:
        assert "ISSIA's files were not there" in page(study)
        assert "The paper's text asks the other way" in page(study)


class TestPrintedJac:
    """A camera that fits, and a marking of which one half alone was clicked."""

    def test_asks_for_what_nobody_clicked(self) -> None:
        size, pitch = ImageSize(1280, 720), Pitch()
        camera = looking((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), 900.0)
        whole = {
            marking: tuple(ImagePoint(*point) for point in polyline.tolist())
            for marking, polyline in project_markings(camera, pitch, size).items()
        }
        half = whole["Middle line"]
        clicked = {**whole, "Middle line": half[: len(half) // 2]}
        assert printed_jaccard(camera, whole, pitch, size, 5.0) == 1.0
        public = camera_jaccard(camera, clicked, pitch, size, (5.0,))[0]
        assert public == 1.0
        assert printed_jaccard(camera, clicked, pitch, size, 5.0) < 1.0
