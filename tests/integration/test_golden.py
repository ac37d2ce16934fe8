"""The file that holds browser and server to the same numbers is what the server says."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.js.golden import FILE, golden

TOLERANCE = 1e-7
"""Pixels, metres: what another processor's rounding may do to ill-conditioned pairs."""


def compare(said: Any, kept: Any, path: str = "") -> None:
    """Fail with the place of the first difference."""
    if isinstance(said, dict):
        assert list(said) == list(kept), path
        for name in said:
            compare(said[name], kept[name], f"{path}/{name}")
    elif isinstance(said, list | tuple):
        assert len(said) == len(kept), path
        for index, (one, other) in enumerate(zip(said, kept, strict=True)):
            compare(one, other, f"{path}/{index}")
    elif isinstance(said, float):
        assert said == pytest.approx(kept, rel=1e-9, abs=TOLERANCE), path
    else:
        assert said == kept, path


class TestGoldenFile:
    def test_is_what_the_server_computes(self) -> None:
        compare(golden(), json.loads(FILE.read_text("utf-8")))

    def test_stays_small(self) -> None:
        assert FILE.stat().st_size < 100_000

    def test_holds_every_kind_of_lens(self) -> None:
        cameras = json.loads(FILE.read_text("utf-8"))["cameras"]
        plain = [camera for camera in cameras.values() if "lens" not in camera]
        assert any(camera["thin_prism_distortion"][0] for camera in plain)
        assert any(not any(camera["radial_distortion"]) for camera in plain)
        wide = {camera["lens"] for camera in cameras.values() if "lens" in camera}
        assert wide == {"fisheye", "arctan_polynomial"}
