"""Track on a real clip; skipped where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from app.tracking.clip import Clip
from app.tracking.track import track_clip
from tests.bench.track import DATA, clicked, clicked_hits, paint_distances

FOLDER = DATA / "broadcast"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no real clips in {FOLDER}")


@pytest.mark.parametrize("annotated", [[], [47]])
def test_a_real_clip_is_tracked_onto_its_paint(annotated: list[int]):
    file = FOLDER / "clips" / "rma_sev.mp4"
    clip = Clip.open(file)
    known = clicked(clip, file.stem, FOLDER / "lines")
    found = track_clip(file, {number: known[number] for number in annotated}).frames
    tracked = [frame for frame in found if frame.outcome == "tracked"]
    assert len(tracked) >= 0.97 * len(found)
    distances = paint_distances(clip, found)
    assert np.median(distances) < 0.3 and np.percentile(distances, 95) < 0.5
    hits = [hit for number in known for hit in clicked_hits(found[number], known[number])]
    assert np.mean(hits) >= 0.95
    if annotated:
        assert all(found[number].is_keyframe for number in annotated)


@pytest.mark.skipif(not (DATA / "replays").is_dir(), reason=f"no replays in {DATA}")
def test_a_small_clip_is_tracked_where_the_middle_line_comes_into_the_picture():
    found = track_clip(DATA / "replays" / "action_0_clip_0.mp4", {}).frames
    tracked = [frame for frame in found if frame.outcome == "tracked"]
    assert len(tracked) >= 0.97 * len(found)
    # Its first frames alone show the middle line, which tells where the camera stands.
    for frame in found[:8]:
        assert frame.camera is not None and frame.supported is not None
        assert abs(frame.camera.position[0]) < 1 and frame.supported > 0.5
