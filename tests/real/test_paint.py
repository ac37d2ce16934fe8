"""Snap on real broadcast frames; skipped where they are not."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.features.file_tools.paint import measure_paint_agreement_of_files, snap_cameras_to_paint
from app.media.files import decode_frame
from app.paint.propose import propose_camera
from app.paint.view_proposal import propose_lines_in_image
from app.soccer.frames import ImageSize
from app.soccer.group import Media
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.calibrate import calibrate

DATA = Path(
    os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data")
) / "broadcast"  # fmt: skip

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no real frames in {DATA}")


def test_real_stills_are_snapped_or_say_why_not(tmp_path):
    rows = snap_cameras_to_paint(DATA / "lines", [DATA / "stills"], tmp_path, settings=Settings())
    assert len(rows) >= 15
    snapped = [row for row in rows if row["outcome"] == "proposed"]
    assert len(snapped) >= 0.7 * len(rows)
    assert all(row["error_px"] < 0.8 and row["supported"] > 0.6 for row in snapped)
    assert all(row["reason"] for row in rows if row["outcome"] != "proposed")


def test_cameras_of_real_stills_agree_with_no_picture_of_something_else(tmp_path):
    snap_cameras_to_paint(DATA / "lines", [DATA / "stills"], tmp_path, settings=Settings())
    rows = measure_paint_agreement_of_files(tmp_path, [DATA / "stills"], settings=Settings())
    assert all(row["supported"] * row["explained"] > 0.2 for row in rows if row["supported"])


def test_accepted_proposals_qualify_with_the_goals_that_are_seen():
    """Nine lines of twelve markings are a JaC of 0.75, which must be exceeded."""
    counted, pitch = 0, Pitch()
    for path in sorted((DATA / "stills").iterdir()):
        image = decode_frame(Media(str(path)), False, Settings())
        size = ImageSize(image.shape[1], image.shape[0])
        found = propose_lines_in_image(image, size, (), pitch, PAPER.calibration)
        if found.outcome == "proposed":
            made = calibrate(found.lines, pitch, size, PAPER.calibration)
            assert made.jac is not None and made.jac[0] > PAPER.min_jac, path.name
            counted += 1
    assert counted >= 19


def test_a_marking_that_lost_its_paint_on_the_way_is_drawn_onto_it_once_more():
    """Mirrored, the same picture showed that edge of the penalty area on its paint at once."""
    image = decode_frame(Media(str(DATA / "stills" / "wc10_a.png")), False, Settings())
    found = [propose_camera(picture) for picture in (image, np.ascontiguousarray(image[:, ::-1]))]
    assert [one.outcome for one in found] == ["proposed", "proposed"]
    assert min(one.weakest for one in found) > 0.7
    here, there = (one.camera.position for one in found)
    assert np.hypot(*(here - there * [-1, 1, 1])[1:]) < 0.5
