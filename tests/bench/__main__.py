"""``make bench``: what Touchline measures of itself, printed as tables.

Accuracy is compared with published figures of PnLCalib, speed with libraries in the same run.
Timings gate no test: machines are shared and noisy.
"""

from __future__ import annotations

import os
from pathlib import Path

from tests.bench.annotators import bench_annotators
from tests.bench.ball import bench_ball
from tests.bench.ball_follow import bench_ball_follow
from tests.bench.ball_noise import bench_ball_noise
from tests.bench.ball_track import bench_ball_track
from tests.bench.browser import bench_browser
from tests.bench.calibration import bench_calibration
from tests.bench.clips import bench_clips
from tests.bench.drawn import bench_drawn
from tests.bench.geometry import bench_geometry
from tests.bench.goals import bench_goals
from tests.bench.line_coverage import bench_line_coverage
from tests.bench.link import bench_link
from tests.bench.listeners import bench_listeners
from tests.bench.lone_frames import bench_lone_frames
from tests.bench.long_recording import bench_long_recording
from tests.bench.page_loads import bench_page_loads
from tests.bench.paint import bench_paint
from tests.bench.people import bench_people
from tests.bench.picture_power import bench_picture_power
from tests.bench.pictures import bench_pictures
from tests.bench.pitches import bench_pitches
from tests.bench.propose import bench_propose
from tests.bench.recording import bench_recording
from tests.bench.requests import bench_requests
from tests.bench.rigs import bench_rigs
from tests.bench.shipped import bench_shipped
from tests.bench.shots import bench_shots
from tests.bench.track import bench_track
from tests.bench.track_edits import bench_track_edits
from tests.bench.truth import bench_truth

REAL_DATA = Path(
    os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data")
)


def main() -> None:
    """Run every benchmark; those on real data only where it is."""
    bench_ball()
    bench_ball_noise()
    bench_truth()
    bench_shipped()
    bench_annotators()
    bench_pictures()
    bench_picture_power()
    bench_pitches()
    bench_lone_frames()
    bench_line_coverage(REAL_DATA, 3)
    bench_geometry()
    if (REAL_DATA / "sn22-dev" / "lines.zip").is_file():
        bench_calibration(REAL_DATA)
        bench_goals(REAL_DATA)
    else:
        print(f"\nCalibration on real lines: no data in {REAL_DATA}, left out")
    if (REAL_DATA / "issia-lines").is_dir():
        bench_rigs(REAL_DATA)
    if (REAL_DATA / "issia").is_dir():
        bench_people(REAL_DATA)
    bench_paint(REAL_DATA)
    bench_drawn()
    bench_clips(REAL_DATA)
    bench_propose(REAL_DATA)
    bench_shots(REAL_DATA)
    bench_track(REAL_DATA)
    bench_link(REAL_DATA)
    bench_long_recording()
    bench_recording()
    bench_ball_follow(90)
    bench_ball_track(REAL_DATA)
    bench_requests()
    bench_listeners()
    bench_browser()
    bench_track_edits(REAL_DATA)
    bench_page_loads()


if __name__ == "__main__":
    main()
