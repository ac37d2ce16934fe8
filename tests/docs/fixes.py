"""Fixes: from a finding or a remedy to the request that carries it out; docs/fixes.md is written from this."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[2] / "docs" / "fixes.md"
TEXT = """
What the browser's buttons do, as requests. Findings (`views[].findings`, `GET /findings`) and remedies (`GET /groups/{id}/suggestions`) say in
`fix.action`, or `edit.action`, what they propose, and in `offers` hold the edit that does it, or in `guide` say where a person has to look or draw.
Buttons and pictures are made of `offers`, `guide` and their captions alone: callers do not need to know the actions. Every request below takes `If-Match` with the
**group's** ETag and answers the whole group, solved; `POST /groups/{id}/undo` takes it back. A static camera's lines belong to its station:
`PATCH /stations/{id}/lines?group={id}` with the station's ETag.
""".strip()

EDITS = {
    "set_lines": ("PATCH /views/{id}/lines", '{"lines": {"Circle left": [{"x": 12.5, "y": 398.0}], "Side line top": null}}'),
    "set_balls": ("PATCH /views/{id}/ball", '{"box": [391.4, 348.0, 13.4, 13.1]}, or {"point": [398, 354]}'),
    "include_view": ("PATCH /views/{id}", '{"included": false, "reason": "not_same_instant"}'),
    "set_picture": ("PATCH /views/{id}", '{"picture": {}}'),
}  # fmt: skip
"""By the name of an edit: its request, and an example of a body."""

ACTIONS: dict[str, tuple[str, str | None]] = {
    "relabel": ("the points of a marking go to the class that fits", "set_lines"),
    "swap_sides": ("every marking under the name of its twin", "set_lines"),
    "pick_ball": ("one of several balls is the one in play: one offer for each", "set_balls"),
    "free_picture": ("the lines say how the picture was stretched or cropped", "set_picture"),
    "move_ball": ("the ball goes to where its track is seen", "set_balls"),
    "move_point": ("a point of a marking goes where `point` says", "set_lines"),
    "drop_point": ("a point of a marking goes", "set_lines"),
    "drop_marking": ("a marking goes", "set_lines"),
    "hide_marking": ("a marking is said not to be visible: a stub of a few pixels", "set_lines"),
    "include_view": ("a view that a person left out is used again", "include_view"),
    "exclude_view": ("a view is left out", "include_view"),
    "look_ball": ("no edit: look whether the ball is at `point`, then send its box", None),
    "draw_marking": ("no edit: the marking is visible and not drawn; draw it", None),
    "read_paint": ("no edit: the picture is read again, with those of its match", None),
}
"""By the action of a fix: what it does, and its edit."""
BY_HAND = {
    "look_ball": "as `set_balls`",
    "draw_marking": "as `set_lines`",
    "read_paint": '`POST /datasets/{id}/paint` with `{"match"}`, a job',
}
"""What to send where no edit is offered, once somebody has looked."""

FINDINGS: dict[str, tuple[tuple[str, ...], str]] = {
    "wrong_label": (("relabel", "drop_marking"), ""),
    "sides_swapped": (("swap_sides",), ""),
    "visible_not_annotated": ((), "draw the marking that `guide` names: `PATCH /views/{id}/lines`"),
    "bad_point": (("drop_point",), ""),
    "under_constrained": ((), "draw more markings: `PATCH /views/{id}/lines`"),
    "paint_disagrees": (
        (),
        "correct the lines; their paint is read again with the edit",
    ),
    "no_paint": (
        ("read_paint",),
        "where paint was read and shows too little, correct the lines",
    ),
    "picture_geometry": (("free_picture",), ""),
    "camera_size": ((), "import the cameras again with the size that they were made for"),
    "view_disagrees": (("exclude_view",), "or correct its ball: `PATCH /views/{id}/ball`"),
    "views_contradict": (("exclude_view",), ""),
    "not_synchronous": ((), "correct a ball, or reject: `PUT /groups/{id}/verdict`"),
    "ball_size": (
        (),
        "`offers` has a box of the right size; if it is not the ball, correct it: `PATCH /views/{id}/ball`",
    ),
    "low_parallax": ((), "nothing mends it; reject, or ask for more: `PUT /datasets/{id}/policy`"),
    "high_uncertainty": ((), "the same"),
    "implausible_ball": ((), "correct a ball or its lines"),
    "implausible_camera": ((), "correct the lines: `PATCH /views/{id}/lines`"),
    "several_balls": (("pick_ball",), ""),
    "upstream_changed": ((), "keep it, or send what the files say: `PATCH /views/{id}/...`"),
    "pitch_size": (
        (),
        "`PATCH /datasets/{id}/pitches` with the size that is proposed; of a frame alone, import it anew with its match",
    ),
    "track_disagrees": (
        ("move_ball", "exclude_view"),
        "`offers` has its other balls too; then recompute the track: `POST /datasets/{id}/tracks`",
    ),
}
"""By the kind of a finding: what it proposes, and what else there is to do."""


def request_of(edit: dict[str, Any], views: dict[str, int]) -> tuple[str, dict[str, Any] | None]:
    """Address and body of the PATCH that an offered edit means; ``views``: ids by key."""
    place = f"/api/v1/views/{views[edit['view']]}"
    if edit["edit"] == "set_lines":
        lines = {
            marking: [{"x": x, "y": y} for x, y in points] if points else None
            for marking, points in edit["lines"].items()
        }
        source = edit.get("source", {})
        hidden = [marking for marking in source if source[marking] == "not_visible"]
        return f"{place}/lines", {"lines": lines, **({"not_visible": hidden} if hidden else {})}
    if edit["edit"] == "set_balls":
        ball = edit["balls"][0] if edit["balls"] else None
        return f"{place}/ball", ball and {key: ball[key] for key in ball if ball[key] is not None}
    name = {"include_view": "included", "set_picture": "picture"}[edit["edit"]]
    return place, {name: edit[name]}


def fixes_page() -> str:
    """What docs/fixes.md has to say."""
    edits = [f"| `{name}` | `{request}` | `{body}` |" for name, (request, body) in EDITS.items()]
    actions = [
        f"| `{name}` | {what} | {f'`{edit}`' if edit else BY_HAND[name]} |"
        for name, (what, edit) in ACTIONS.items()
    ]
    findings = [
        f"| `{kind}` | {', '.join(f'`{name}`' for name in proposed) or '–'} | {more} |"
        for kind, (proposed, more) in FINDINGS.items()
    ]
    parts = [
        "# From a finding to its request",
        TEXT,
        "## Edits",
        "\n".join(
            ["| `offers[].edit.edit` | request | body, for example |", "|---|---|---|", *edits]
        ),
        "An offer as a request, in Python:",
        f"```python\n{inspect.getsource(request_of)}```",
        "## Actions",
        "\n".join(["| `action` | what it does | edit |", "|---|---|---|", *actions]),
        "## Findings",
        "\n".join(["| kind | proposes | what else to do |", "|---|---|---|", *findings]),
        "Suggestions propose `move_point`, `drop_point`, `drop_marking`, `include_view`, `exclude_view`, `relabel`, `swap_sides`, `pick_ball` and "
        "`free_picture` where the solver has tried out that they help, and `look_ball` and `draw_marking` where a person has to look.",
    ]
    return "\n\n".join(parts) + "\n"
