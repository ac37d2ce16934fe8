"""Paint evidence as JSON."""

from __future__ import annotations

import pytest

from app.errors import InputError
from app.finite import json_text
from app.soccer.paint_evidence import (
    PaintEvidence,
    PaintPoint,
    evidence_from_json,
    evidence_to_json,
)


class TestCodec:
    def test_every_digit_comes_back(self):
        import json

        points = {"Middle line": (PaintPoint(1 / 3, 2.0, 0.05), PaintPoint(3.0, 4.0, 0.07))}
        evidence = PaintEvidence(points, "7")
        assert evidence_from_json(json.loads(json_text(evidence_to_json(evidence)))) == evidence

    @pytest.mark.parametrize(
        "value",
        [
            None,
            {"version": "1"},
            {"version": "1", "points": {"Middle line": [[1.0, 2.0]]}},
            {"version": "1", "points": {"Middle line": [[1.0, 2.0, 0.0]]}},
            {"version": "1", "points": {"Middle line": [[1.0, float("nan"), 0.1]]}},
            {"version": "1", "points": {"Halfway": [[1.0, 2.0, 0.1]]}},
        ],
    )
    def test_what_is_no_evidence_is_refused(self, value):
        with pytest.raises(InputError):
            evidence_from_json(value)
