"""Solver: the type of the one function that turns a group into its solution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Calibration, Solution


class Solver(Protocol):
    """``app.solving.solve.solve``, or what a test puts in its place.

    Pure and deterministic. ``calibrations`` holds known ones by their key and only saves time.
    """

    def __call__(
        self, group: Group, policy: Policy, calibrations: Mapping[str, Calibration] = ...
    ) -> Solution: ...
