"""Known calibrations: what the solver need not work out again, looked up by the solver's key."""

from __future__ import annotations

from collections.abc import Iterable

from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.calibrate import view_keys
from app.store.session import Session
from app.store.solutions import read_calibrations


def calibration_keys(groups: Iterable[Group], policy: Policy) -> set[str]:
    """Keys of the calibrations that groups need under a policy, or that those start from."""
    part = policy.calibration
    return {key for group in groups for view in group.views for key in view_keys(group, view, part)}


def known_calibrations(
    session: Session, groups: Iterable[Group], policy: Policy
) -> dict[str, Calibration]:
    """Those of the calibrations that groups need which are kept already."""
    return read_calibrations(session, calibration_keys(groups, policy))
