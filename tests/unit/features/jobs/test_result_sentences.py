"""What a finished job says of itself is a result: nothing is still being done."""

from __future__ import annotations

import re
from typing import get_args

import pytest

from app.features.jobs.result_sentences import describe_result
from app.features.jobs.schemas import JobKind

SOLVED = {"groups": 60, "solved": 60, "passed": 52, "failed": 0, "failures": []}
IMPORTED = {"new": 2, "changed": 1, "unchanged": 0, "skipped": [{}], "more_skipped": 0}
YOLO = {"groups": 4, "labels": 8, "images": 0, "images_missing": 8}
RESULTS = [
    ("solve", SOLVED, "60 groups solved: 52 pass, 8 do not; 0 errors."),
    (
        "solve",
        {**SOLVED, "failing": {"jac": 7, "ball": 1}, "advice": "Look at cam3."},
        "60 groups solved: 52 pass, 8 do not (first failing gate: jac 7, ball 1); 0 errors. Look at "
        "cam3.",
    ),
    ("solve", {**SOLVED, "solved": 0, "passed": 0}, "Nothing was left to solve."),
    (
        "solve",
        {**SOLVED, "solved": 0, "passed": 0, "estimated": 4, "proposed": 1},
        "The pitch of 4 matches was estimated: another size is proposed for 1 match.",
    ),
    (
        "solve",
        {**SOLVED, "estimated": 1, "proposed": 0},
        "60 groups solved: 52 pass, 8 do not; 0 errors. The pitch of 1 match was estimated: no "
        "other size is proposed.",
    ),
    (
        "import",
        {**IMPORTED, "dry_run": False},
        "3 groups read: 2 new, 1 changed, 0 unchanged; 1 record left out.",
    ),
    (
        "import",
        {**IMPORTED, "skipped": [], "dry_run": True},
        "3 groups read: 2 new, 1 changed, 0 unchanged (dry run: nothing was changed).",
    ),
    ("export", {"format": "coco", "counts": {"groups": 4}}, "Written: 4 groups."),
    (
        "export",
        {"format": "yolo", "counts": YOLO},
        "Written: 4 groups, 8 labels, 0 images, 8 images missing. 8 images are not in this "
        "export; frames.csv names their places.",
    ),
    ("freeze", {"name": "v1", "counts": {"groups": 1}}, "Version v1 holds 1 group."),
    ("verify", {"sentence": "All 4 groups came out equal."}, "All 4 groups came out equal."),
    ("evaluate", {"name": "yolo-a"}, "Evaluation yolo-a is ready."),
    (
        "bulk",
        {"changed": 3, "groups": 2, "refused": {"stale": 1}},
        "3 views of 2 groups have a ball from predictions; 1 view refused.",
    ),
    ("practice", {"groups": 8, "made": True}, "8 practice groups made."),
    ("practice", {"groups": 8, "made": False}, "The 8 practice groups already exist."),
    ("practice", {"recording": 1, "made": True}, "The practice recording is made."),
    ("practice", {"recording": 1, "made": False}, "The practice recording already exists."),
    ("rig", {"cameras": [1, 2], "accepted": None}, "An adjustment of 2 cameras is proposed."),
    (
        "rig",
        {"cameras": [1], "accepted": "all"},
        "The adjustment of 1 camera was accepted (all).",
    ),
    (
        "positions",
        {"matches": 2, "shared": 40},
        "40 pictures of 2 matches share the position of their camera.",
    ),
    ("paint", {"read": 12}, "The paint of 12 pictures was read."),
    (
        "proposals",
        {"proposed": 3, "unsure": 1, "nothing": 2},
        "6 views looked at: 3 proposed, 1 unsure, 2 without a proposal.",
    ),
    (
        "pictures",
        {"items": [{"proposed": None}, {"proposed": {}}]},
        "2 matches estimated, 1 with a proposal.",
    ),
    (
        "track",
        {"name": "half", "frames": 1500, "tracked": 1480, "bridged": 8, "lost": 12, "groups": 2},
        "1,500 frames of half: 1,480 tracked, 8 bridged, 12 lost; 2 groups got another camera.",
    ),
    (
        "recording",
        {"name": "half.mp4", "frames": 1500, "shots": 1},
        "half.mp4 has 1,500 frames in 1 shot.",
    ),
    (
        "instants",
        {"name": "half.mp4", "new": 4, "unchanged": 0},
        "4 groups made of half.mp4.",
    ),
    (
        "instants",
        {"name": "half.mp4", "new": 4, "unchanged": 0, "dry_run": True},
        "4 groups would be made of half.mp4.",
    ),
    (
        "instants",
        {"name": "half.mp4", "new": 1, "unchanged": 3},
        "1 group made of half.mp4; 3 were there before.",
    ),
    (
        "instants",
        {
            "name": "half.mp4",
            "new": 1,
            "changed": 2,
            "unchanged": 0,
            "linked_views": 3,
            "outside": 1,
        },
        "1 group made of half.mp4; 2 groups got views of replays; 3 views of linked replays "
        "added, 1 missing.",
    ),
    (
        "link",
        {"reason": None, "rays": (90, 140), "left_out": 0},
        "The times were found (90 rays of the live shot, 140 of the replay).",
    ),
    (
        "link",
        {"reason": "The ball hardly moves.", "rays": (90, 140), "left_out": 3},
        "The ball hardly moves (90 rays of the live shot, 140 of the replay, 3 left out).",
    ),
    (
        "ball",
        {"made": 2, "unchanged": 0, "without": []},
        "The ball was tracked over 2 stretches.",
    ),
    (
        "ball",
        {"made": 1, "unchanged": 3, "without": [{"stretch": "a", "reason": "b"}]},
        "The ball was tracked over 1 stretch; 3 were up to date; 1 has no track.",
    ),
]


class TestEnding:
    @pytest.mark.parametrize(("kind", "result", "told"), RESULTS)
    def test_every_kind_tells_its_result(self, kind: str, result: object, told: str) -> None:
        assert describe_result(kind, result) == told

    def test_no_kind_is_forgotten(self) -> None:
        # Nothing asks for the kind "detect" any more; its jobs are listed.
        assert {kind for kind, *_ in RESULTS} == {*get_args(JobKind)} - {"detect"}

    @pytest.mark.parametrize("told", [told for *_, told in RESULTS])
    def test_none_says_that_something_is_being_done(self, told: str) -> None:
        assert not re.match(r"(?!Nothing)[A-Z]\w+ing\b", told)

    def test_a_result_of_another_shape_says_nothing(self) -> None:
        assert describe_result("bulk", "whatever") is None
        assert describe_result("solve", {}) is None
        assert describe_result("unknown", {}) is None
