"""Line edits as they travel."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.features.groups.edit_schemas import LinesEdit


def test_of_each_marking_the_first_wrong_point_is_told() -> None:
    """One that tells all of thousands keeps everybody waiting meanwhile."""
    lines = {"Middle line": [{"x": 1.0, "y": 2.0}, *[1] * 3000], "Circle central": [2] * 3000}
    with pytest.raises(ValidationError) as refused:
        LinesEdit.model_validate({"lines": lines})
    told = [error["loc"] for error in refused.value.errors()]
    assert told == [("lines", "Middle line", 1), ("lines", "Circle central", 0)]
