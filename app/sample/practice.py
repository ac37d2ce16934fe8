"""Practice: eight groups to learn on, each with one known fault or none, and the truth beside them.

The numbers are chosen so that every lesson shows its problem under the policy ``paper``; the
ordinary sample does not know them.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2

from app.formats.soccernet_v3 import ARCHIVE
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.json_text import json_text
from app.progress import ReportProgress
from app.sample.faults import FaultPlan
from app.sample.render import render
from app.sample.scene import TRUTH, Scene, TruthWriter, truth_to_json
from app.sample.scenes import Stage, make_scene, make_stage
from app.sample.write import JPEG_QUALITY, ZIP_DATE

SEED = 20_260_808
MATCH_GROUPS = 800
"""Groups that the match of the lessons has; most of them are never made."""
CLEAN = "clean"
"""Kind of a lesson without a fault."""


@dataclass(frozen=True)
class Lesson:
    """Which scene a lesson is made of.

    Attributes:
        kind: ``CLEAN``, or one of ``PRACTICE_KINDS``.
        number: Number of the scene; lessons stand in the order of their numbers.
        view: Place of the view that carries the fault.
        seed: Seed of the fault.
    """

    kind: str
    number: int
    view: int = 0
    seed: int = 0


LESSONS = (
    Lesson(CLEAN, 3),
    Lesson("wrong_label", 102, view=1, seed=1),
    Lesson("swapped_sides", 201, view=1),
    Lesson("bad_point", 368, view=0, seed=1),
    Lesson("missing_ball", 401, view=1),
    Lesson("not_synchronous", 503, view=1, seed=1),
    Lesson("undrawn_line", 618, view=0, seed=1),
    Lesson("tiny_baseline", 701, view=1, seed=1),
)


def make_practice() -> list[Scene]:
    """The scenes of all lessons, in their order."""
    stage = practice_stage()
    return [make_scene(stage, lesson.number, _fault_plan_of_lesson(lesson)) for lesson in LESSONS]


def practice_stage() -> Stage:
    """The match that all lessons are from."""
    return make_stage(0, MATCH_GROUPS, SEED)


def _fault_plan_of_lesson(lesson: Lesson) -> FaultPlan | None:
    if lesson.kind == CLEAN:
        return None
    return FaultPlan(lesson.kind, lesson.view, lesson.seed)


def write_practice(out: Path, progress: ReportProgress | None = None) -> None:
    """Write the lessons as a SoccerNet-v3 tree with ``truth.json`` beside it.

    What an earlier call left there is replaced by the same bytes.

    Args:
        out: Folder, made when missing.
        progress: Called after each frame.
    """
    scenes = make_practice()
    out.mkdir(parents=True, exist_ok=True)
    write_soccernet_v3(out, [scene.group for scene in scenes])
    _write_frames(out / scenes[0].fixture.folder / ARCHIVE, scenes, progress)
    temporary = out / f".{TRUTH}.part"
    with temporary.open("w", encoding="utf-8") as stream:
        writer = TruthWriter(stream, SEED)
        writer.write(
            (scene.truth.key, json_text(truth_to_json(scene.truth), compact=True))
            for scene in scenes
        )
        writer.close()
    # The truth comes last: where it is, everything is.
    temporary.replace(out / TRUTH)


def _write_frames(archive: Path, scenes: list[Scene], progress: ReportProgress | None) -> None:
    frames = [(scene, view.key) for scene in scenes for view in scene.group.views]
    temporary = archive.with_suffix(".part")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as members:
        for done, (scene, key) in enumerate(frames, start=1):
            quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
            _, content = cv2.imencode(".jpg", render(scene, key), quality)
            members.writestr(zipfile.ZipInfo(key, ZIP_DATE), content.tobytes())
            if progress is not None:
                progress(done, len(frames))
    temporary.replace(archive)
