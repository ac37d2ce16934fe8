"""What a parsed JSON document is, in words, for the error where another one was meant."""

from __future__ import annotations

from typing import Any

from app.finite import quoted
from app.formats.camera_matrix import holds_homography, holds_matrices
from app.soccer.pitch import marking_like

EVALUATE = "touchline evaluate"
EXPORT = "export it as COCO from your tool and import that"
_KEYS = 4
"""Keys that are named of an object that is nothing known."""


def json_kind(value: Any) -> str:
    """What a document is, as the end of a sentence that begins with its name.

    Example:
        >>> json_kind({"kp": {}, "lines": {}})
        'holds keypoints that a detector predicted (kp), not annotated lines'
    """
    if holds_homography(value):
        return (
            "holds a homography: it maps the grass alone and is no camera (no focal length, no height). "
            "Write K, R and t, or SoccerNet's camera JSON"
        )
    if isinstance(value, list):
        return _kind_of_list(value)
    if not isinstance(value, dict):
        return f"is {quoted(value, 40) if isinstance(value, str) else value}, not an object"
    return _kind_of_object(value)


def is_camera(value: Any) -> bool:
    """Whether a value looks like one camera, in any spelling that is read."""
    if not isinstance(value, dict):
        return False
    return "pan_degrees" in value or "cam_params" in value or holds_matrices(value)


def is_gamestate(annotations: Any) -> bool:
    """Whether annotations are those of sn-gamestate, whose files are COCO's but for their boxes."""
    listed = annotations[:100] if isinstance(annotations, list) else []
    names = {name for item in listed if isinstance(item, dict) for name in item}
    return "bbox_image" in names and "bbox" not in names


def _kind_of_list(value: list[Any]) -> str:
    first = next((item for item in value if isinstance(item, dict)), None)
    if first is None:
        return f"is a list of {len(value)} values"
    if "bbox" in first and "image_id" in first:
        return f"holds COCO results, boxes that a detector predicted: evaluate them ({EVALUATE})"
    if is_camera(first):
        return "holds cameras: import it as cameras"
    return f"is a list of objects with {_names(first)}"


def _kind_of_object(value: dict[str, Any]) -> str:
    if is_gamestate(value.get("annotations")):
        return "is a file of sn-gamestate: import it as gamestate"
    if "images" in value and ("annotations" in value or "categories" in value):
        return "is a COCO document: import it as coco"
    if is_camera(value):
        return "holds a camera: import it as cameras"
    for name in ("kp", "keypoints", "kps"):
        if name in value:
            return f"holds keypoints that a detector predicted ({name}), not annotated lines"
    if "actions" in value or "replays" in value:
        return "holds the labels of a match: import it as soccernet-v3 or soccernet-v3d"
    if "shapes" in value and "imagePath" in value:
        return f"is an annotation of LabelMe: {EXPORT}"
    if any(map(is_camera, value.values())):
        return "holds cameras: import it as cameras"
    if any(map(marking_like, value)):
        return "holds field lines: import it as sn-calibration"
    return f"is an object with {_names(value)}" if value else "is an empty object"


def _names(value: dict[str, Any]) -> str:
    names = ", ".join(quoted(name, 30) for name in list(value)[:_KEYS])
    return f"{names} and {len(value) - _KEYS} more" if len(value) > _KEYS else names
