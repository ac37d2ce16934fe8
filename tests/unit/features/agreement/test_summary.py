"""Summary: how far all who annotated agree."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from app.features.agreement.summary import _summarize_overall_agreement

PEOPLE = ("ada", "bo", "cy")


def judged(*verdicts: str | None) -> Any:
    """A group as each person judged it, or did not."""
    return SimpleNamespace(verdicts=dict(zip(PEOPLE, verdicts, strict=False)), pairs=())


def test_fleiss_kappa_is_told_where_all_groups_were_judged_by_equally_many() -> None:
    groups = [judged("accepted", "accepted"), judged("rejected", "rejected")]
    kappa = _summarize_overall_agreement(PEOPLE, groups).kappa
    assert kappa is not None and kappa.value == pytest.approx(1.0)


def test_where_they_were_judged_by_unequal_numbers_it_is_not() -> None:
    groups = [judged("accepted", "accepted", "accepted"), judged("rejected", "rejected")]
    assert _summarize_overall_agreement(PEOPLE, groups).kappa is None


def test_a_group_that_one_alone_judged_says_nothing() -> None:
    groups = [judged("accepted", "accepted"), judged("rejected", "rejected"), judged("accepted")]
    assert _summarize_overall_agreement(PEOPLE, groups).kappa is not None
