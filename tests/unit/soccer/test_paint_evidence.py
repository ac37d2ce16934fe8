"""Paint evidence as JSON."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.errors import InputError
from app.json_text import digest_content, json_text
from app.soccer.paint_evidence import (
    PaintEvidence,
    PaintPoint,
    PaintReading,
    evidence_from_json,
    evidence_to_json,
    reading_from_canonical_json,
    reading_from_json,
    reading_to_json,
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


POINTS = {"Middle line": (PaintPoint(1 / 3, 2.0, 0.05),)}
READING = PaintReading("frame", "key", PaintEvidence(POINTS), None, 1 / 3, 0.5)


class TestReading:
    def test_every_digit_comes_back_and_so_does_the_digest(self):
        again = reading_from_json(reading_to_json(READING))
        assert (again, again.digest) == (READING, READING.digest)
        again = reading_from_canonical_json(READING.canonical_json)
        assert (again, again.digest) == (READING, READING.digest)

    def test_the_digest_of_what_is_read_is_that_of_its_text(self):
        spaced = READING.canonical_json.replace(":", ": ", 1)
        again = reading_from_canonical_json(spaced)
        assert again == READING
        assert again.digest == digest_content(spaced.encode()) != READING.digest

    @pytest.mark.parametrize(
        "changes",
        [
            {"frame": "another"},
            {"sought_for": "another"},
            {"evidence": PaintEvidence({})},
            {"evidence": PaintEvidence(POINTS, "0")},
            {"reason": "no_paint"},
            {"supported": None},
            {"explained": 0.25},
            {"people": "somebody"},
        ],
        ids=lambda item: next(iter(item)),
    )
    def test_the_digest_is_that_of_all_of_it(self, changes):
        assert replace(READING, **changes).digest != READING.digest

    @pytest.mark.parametrize("value", [None, {}, {"frame": "", "sought_for": ""}])
    def test_what_is_no_reading_is_refused(self, value):
        with pytest.raises(InputError):
            reading_from_json(value)
        with pytest.raises(InputError):
            reading_from_canonical_json("{")
