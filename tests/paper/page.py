"""``docs/reproduction.md``: our numbers beside the paper's, and which can be compared."""

from __future__ import annotations

from collections.abc import Iterator

from app.evaluation.evaluate import Evaluation
from app.evaluation.result import Cell
from tests.paper import simulated
from tests.paper.issia import Issia
from tests.paper.printed_jac import Directions
from tests.paper.study import SEED, Study

PAPER_LOCALISATION = {
    ("base", "oracle"): (0.65, 15.3, 18.3, 0.03),
    ("opt", "oracle"): (0.81, 4.2, 5.5, 0.30),
    ("base", "predicted"): (0.65, 15.8, 18.7, 0.03),
    ("opt", "predicted"): (0.81, 4.2, 5.2, 0.26),
}
"""AP@0.5, MAE in metres, MAE in per cent and P_2m of the paper's table 2, SoccerNet-v3D."""
PAPER_ISSIA = {
    "base": (0.04, 28.8, 30.1, 0.00),
    "opt": (0.39, 15.6, 16.9, 0.00),
    "ISSIA": (0.65, 4.2, 4.8, 0.35),
}
"""The same of its table 2, ISSIA-3D, oracle cameras."""
PAPER_BOXES = {"annotated": (0.57, 19.01), "optimized": (0.66, 7.27)}


def page(study: Study, issia: Issia | None = None, directions: Directions | None = None) -> str:
    """The whole page.

    Args:
        study: What the synthetic groups gave.
        issia: What the real ISSIA files gave, where they are.
        directions: JaC in both directions on real lines, where they are.
    """
    return "\n".join([*_head(study), *_boxes(study), *_localisation(study), *_issia(issia),
                      *_sensitivity(study), *_calibration(study), *_direction(directions),
                      *_end()]) + "\n"  # fmt: skip


def _head(study: Study) -> Iterator[str]:
    counts = study.opt.counts
    yield from f"""# The paper's pattern, on data with known truth

Written by `make paper` (`python -m tests.paper`); do not edit. The paper is M. Gutiérrez-Pérez and
A. Agudo, "SoccerNet-v3D: Leveraging Sports Broadcast Replays for 3D Scene Understanding", CVPR
Workshops 2025 (arXiv 2504.10106).

**What this is.** {study.groups} synthetic groups (seed {SEED}) with noisy clicks, loose ball boxes and planted
faults go through the real pipeline: calibration from lines, triangulation, gates, optimised boxes,
and then the real evaluation. {counts["groups"]} groups pass the policy `paper`; {counts["with_3d_ball"]} of their {counts["frames"]} frames have a 3D ball. The
truth is known exactly, so the tight box of the true ball takes the place of a manual reference box.

**What this is not.** There is no detector here. A **simulated detector** takes the place of YOLO:
true boxes with seeded noise (missed {simulated.MISSED:.0%}, {simulated.FALSE_ALARMS:g} false alarms a frame, size noise {simulated.SIZE_NOISE:.0%}, centre noise
{simulated.PLACE_NOISE_PX:g} px + {simulated.PLACE_NOISE_SHARE:.0%} of the diameter). Both detectors find and miss the same balls with the same noise; they
differ only in how loose their boxes are: the mean ratio of their training boxes to the true ones
is {study.looseness[0]:.3f} for annotated and {study.looseness[1]:.3f} for optimised boxes. So the table of localisation shows what loose
boxes do to a place in 3D, and nothing about how well a network finds balls. `docs/detector.md` has
the commands for a real one.

Intervals in brackets are 95 % bootstrap intervals by match; {counts["matches"]} matches make them rough. *n* is what a
number was computed from.
""".splitlines()


def _boxes(study: Study) -> Iterator[str]:
    table = study.opt.table("boxes")
    assert table is not None
    yield from (
        "",
        "## Boxes against reference boxes (the paper's table 1)",
        "",
        "| boxes | IoU, paper | IoU, here | size error, paper | size error, here | n |",
        "|---|---|---|---|---|---|",
    )
    for row in table.rows[:3]:
        paper = PAPER_BOXES.get(row.name)
        said = [f"{paper[0]:.2f}", f"{paper[1]:.2f} %"] if paper else ["", ""]
        overlap, error = row.cells
        yield _line(row.label, said[0], _text(overlap), said[1], _text(error, "%"), overlap.count)
    yield from """
*Comparable:* the optimised row, as a pattern. The looseness of the original boxes was put into the
sample to resemble the paper's, so its row is no evidence of anything. How near the optimised boxes
come to the truth is a result of the pipeline; it beats the paper's because the sample's true boxes
have no annotator, no motion blur and no compression.""".splitlines()


def _localisation(study: Study) -> Iterator[str]:
    yield from (
        "",
        "## 3D from one view (the paper's table 2, SoccerNet-v3D)",
        "",
        "| detector | cameras | | AP@0.5 | MAE | MAE | P 2 m | n |",
        "|---|---|---|---|---|---|---|---|",
    )
    for name, found in (("base", study.base), ("opt", study.opt)):
        for cameras in ("oracle", "predicted"):
            paper = PAPER_LOCALISATION[name, cameras]
            said = [f"{paper[0]:.2f}", f"{paper[1]:.1f} m", f"{paper[2]:.1f} %", f"{paper[3]:.2f}"]
            yield _line(
                f"YOLO {name}", _camera_words(cameras, paper=True), "paper", *said, "of 811"
            )
            yield _line(f"simulated {name}", _camera_words(cameras), "here", *_ours(found, cameras))
    yield from f"""
Over detections with IoU > 0, as in the paper. Without that condition, over all frames with a ball
and a miss counted as a miss: P 2 m is {_value(study.base, "oracle_all", "p_2m"):.2f} (base) and {_value(study.opt, "oracle_all", "p_2m"):.2f} (opt), oracle cameras.

![Share of frames within a distance](images/reproduction-precision-distance.jpg)

*Comparable:* that optimised boxes turn an error of about a fifth of the distance into one of a few
per cent, and P 2 m from nearly nothing to a good part of the frames. That follows from geometry: a
box that is {study.looseness[0] - 1:.0%} too large puts the ball {1 - 1 / study.looseness[0]:.0%} too near. *Not comparable:* the AP and the absolute values,
which follow from the noise of a simulated detector. Its size noise was chosen with the paper at hand (about what YOLO opt must
have had to err by 5.5 %), so that the MAE of "opt" is near the paper's is no evidence; that of "base" follows from the looseness. "Predicted cameras" are our own calibration
from lines with {simulated.LINE_NOISE_PX:g} px more noise; the paper's come from PnLCalib's networks.""".splitlines()


def _issia(issia: Issia | None) -> Iterator[str]:
    yield from ("", "## ISSIA-3D (the paper's table 2, last rows)", "")
    if issia is None:
        yield "ISSIA's files were not there when this page was written (`TOUCHLINE_REAL_DATA`)."
        return
    images = issia.train + issia.test
    yield from f"""From the real files: {issia.groups:,} moments keep a 3D ball, and {images:,} images are in a valid pair: {issia.train:,} of cameras
3 to 6 (train) and {issia.test:,} of cameras 1 and 2 (test). The paper says 10,544 images, 8,686 and 1,858; the recording has
4,275 annotated balls in all, so that number cannot count images with a triangulated ball.

| detector | cameras | | AP@0.5 | MAE | MAE | P 2 m | n |
|---|---|---|---|---|---|---|---|""".splitlines()
    for name, (ap, metres, percent, near) in PAPER_ISSIA.items():
        numbers = (f"{ap:.2f}", f"{metres:.1f} m", f"{percent:.1f} %", f"{near:.2f}")
        yield _line(f"YOLO {name}", "oracle", "paper", *numbers, "of 1,858")
    yield _line("simulated, optimised boxes", "given", "here", *_ours(issia.found, "oracle"))
    yield from """
*Comparable:* the counts. *Not comparable:* the last row, whose detector is simulated as above; it says that with a size noise of
7 % ISSIA's far cameras are as hard as SoccerNet's. ISSIA annotates points, so there are no loose boxes to learn from, and
no row for a detector that learnt from them.

The paper leaves time to future work; what one track over all of ISSIA brings stands in [Ball](ball.md#tracks-of-issia).""".splitlines()


def _sensitivity(study: Study) -> Iterator[str]:
    table = study.opt.table("sensitivity")
    assert table is not None
    yield from (
        "",
        "## Sensitivity (the paper's figure 6)",
        "",
        "| change | paper | here: smallest to largest | median | by the derivative "
        "| correlation with distance | n |",
        "|---|---|---|---|---|---|---|",
    )
    for row, paper in zip(table.rows, ("6 to 14 m", "0.6 to 1.6 m"), strict=True):
        smallest, median, largest, slope, correlation = (cell.value or 0.0 for cell in row.cells)
        yield _line(row.label, paper, f"{smallest:.2g} to {largest:.3g} m", f"{median:.2g} m",
                    f"{slope:.2g} m", f"{correlation:.2f}", row.cells[0].count)  # fmt: skip
    yield from """
![Sensitivity of the ball from one view](images/reproduction-sensitivity.jpg)

*Comparable:* all of it, for it is geometry: the size moves the ball along its ray in proportion to
the distance, and a shift of the centre moves it across, in proportion to distance over focal
length, which zooming keeps alike. The smallest values here are lower because the sample has
replays from nearer by. The derivative is below the median for the size because a box that is ten
per cent too small moves the ball by eleven.""".splitlines()


def _calibration(study: Study) -> Iterator[str]:
    table = study.opt.table("calibration")
    assert table is not None
    yield from ("", "## Calibration against annotated lines", "")
    columns = ("completeness", "jac_0.5", "jac_1", "jac_2", "share", "challenge")
    labels = [next(c.label for c in table.columns if c.name == name) for name in columns]
    yield _line("cameras", *labels, "n")
    yield _line(*["---"] * (len(columns) + 2))
    for row in table.rows:
        cells = [table.cell(row.name, name) for name in columns]
        yield _line(row.label, *(f"{cell.value:.3f}" for cell in cells), cells[0].of)
    yield from """
*Comparable:* no. The paper reports how many systems are left at each threshold of real frames
(its figure of JaC thresholds); `docs/calibration.md` has JaC on real frames beside PnLCalib's.""".splitlines()


def _direction(directions: Directions | None) -> Iterator[str]:
    yield from """
**Which way JaC is measured.** The public evaluator and Touchline test whether every *annotated* point lies near the
projected marking. The paper's text asks the other way: whether every point of the *projected* marking lies near the
annotated one. That test fails where the annotation does not reach the end of the marking.""".splitlines()
    if directions is not None:
        yield (
            f"On {directions.frames} real frames the same cameras reach JaC 0.5 % {directions.public:.2f} "
            f"the first way and {directions.printed:.2f} the second."
        )


def _end() -> Iterator[str]:
    yield from """
## What is missing for a true reproduction

The paper's own numbers need SoccerNet-v3 frames and labels, the authors' reference boxes of a tenth
of the training images, and YOLO weights trained on them; none of these come with Touchline. With
them, the same tables come from `touchline evaluate` on a frozen version:

```sh
touchline import soccernet-v3 SOCCERNET --dataset soccernet && touchline solve --dataset soccernet
touchline freeze --dataset soccernet --groups passing --name paper
touchline evaluate --dataset soccernet --version paper --split test yolo-results.json \\
    --images instances_test.json --reference reference-boxes.csv --cameras pnlcalib-cameras.zip --out results
```""".splitlines()


def _ours(found: Evaluation, cameras: str) -> list[object]:
    detection, places = found.table("detection"), found.table("localization")
    assert detection is not None and places is not None
    cells = [places.cell(cameras, name) for name in ("mae_m", "mae_percent", "p_2m")]
    texts = [_text(cell, unit) for cell, unit in zip(cells, ("m", "%", ""), strict=True)]
    return [_text(detection.cell("all", "ap_50")), *texts, cells[0].count]


def _value(found: Evaluation, row: str, column: str) -> float:
    table = found.table("localization")
    assert table is not None
    return table.cell(row, column).value or 0.0


def _text(cell: Cell, unit: str = "") -> str:
    end = f" {unit}" if unit else ""
    if cell.value is None:
        return "-"
    spread = "" if cell.low is None else f" [{cell.low:.2f}, {cell.high:.2f}]"
    return f"**{cell.value:.2f}{end}**{spread}"


def _camera_words(cameras: str, *, paper: bool = False) -> str:
    if cameras == "oracle":
        return "oracle"
    return "PnLCalib" if paper else "noisy lines"


def _line(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"
