"""Yields: what a dataset's policy lets through, and what another one would."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import BeforeValidator, ConfigDict, Field, create_model

from app.features.datasets.service import dataset_id
from app.features.policies.schemas import PolicyDocument
from app.features.what_if.funnel import UNSOLVED, Yield, count_yield
from app.http.deps import AppServices, DatasetPath
from app.http.documents import Document
from app.http.permissions import Action, OwnedKind, may
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.soccer.policy import CalibrationPolicy, Policy
from app.soccer.thresholds import THRESHOLDS, Threshold, list_thresholds

LABELS = {
    UNSOLVED: "Solved",
    "calibratable": "Calibrated",
    "jac": "Field lines fit",
    "agreement": "Paint agrees",
    "two_views": "Two calibrated views",
    "ball": "Ball in two of these views",
    "baseline": "Cameras far enough apart",
    "reprojection": "Views agree on one ball",
    "parallax": "Enough parallax",
    "sigma": "Position certain enough",
    "chi_square": "Residuals small enough",
}
"""What a step of the funnel asks, for people."""


OPTIONAL = frozenset(item.name for item in THRESHOLDS if item.optional)
"""Gates that a policy need not ask for."""
router = APIRouter(prefix="/datasets/{dataset}/yield", tags=["yield"], route_class=Route)


def _optional_thresholds_model(part: type[Policy | CalibrationPolicy]) -> Any:
    """A model in which every threshold of a part of the policy can stand or be absent."""
    fields: dict[str, Any] = {
        item.name: (
            _threshold_type(item) | None,
            Field(default=None, description=item.label_with_unit),
        )
        for item in list_thresholds(part)
    }
    return create_model(f"_{part.__name__}", __config__=ConfigDict(extra="forbid"), **fields)


def _threshold_type(item: Threshold) -> Any:
    """The type of a threshold, and between which ends it lies."""
    if item.has_word_choices or item.minimum is None:
        return item.hint
    return Annotated[float, Field(ge=item.minimum, le=item.maximum)]


class CalibrationThresholds(_optional_thresholds_model(CalibrationPolicy)):  # type: ignore[misc]
    """What a view's calibration depends on; only solving again tells what another value does."""


class ThresholdsToTry(_optional_thresholds_model(Policy)):  # type: ignore[misc]
    """Thresholds to try; those that are absent stay as they are.

    `null` switches a gate off (`min_agreement`, `min_parallax_degrees`,
    `max_sigma_m`, `min_p_value`) and says nothing elsewhere.
    """

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"min_jac": 0.8, "min_parallax_degrees": 5.0}]}
    )

    calibration: CalibrationThresholds | None = None

    def to_policy_values(self) -> dict[str, Any]:
        """The fields of a policy that shall differ."""
        sent = self.model_dump(exclude_unset=True)
        calibration = sent.pop("calibration", None) or {}
        kept = {
            name: value for name, value in sent.items() if value is not None or name in OPTIONAL
        }
        known = {name: value for name, value in calibration.items() if value is not None}
        return {**kept, "calibration": known}


class FunnelStep(Document):
    """A gate: how many groups are left after it, and for how many it is the first that fails."""

    gate: str
    label: Annotated[str, BeforeValidator(LABELS.__getitem__)] = Field(validation_alias="gate")
    left: int
    dropped: int


class CurveDocument(Document):
    """Groups with the ball in two or more views that qualify, against the JaC threshold."""

    gamma_percent: float
    thresholds: list[float]
    groups: list[int]


class SplitYield(Document):
    """Groups of one split."""

    split: str = Field(validation_alias="name")
    groups: int
    passing: int


class DistanceYield(Document):
    """Groups by distance of the ball from the camera of the first view that it comes from."""

    model_config = ConfigDict(serialize_by_alias=True)

    low: float | None = Field(
        serialization_alias="from",
        description="Metres; null, as `to` is, for groups without a ball.",
    )
    high: float | None = Field(
        serialization_alias="to", description="Upper end of the bin; null: there is none."
    )
    groups: int
    passing: int


class FindingYield(Document):
    """Groups with a finding that follows from a threshold, though it is no gate."""

    kind: str = Field(validation_alias="name")
    groups: int
    passing: int


class SplitCount(Document):
    """Groups of a match in one split."""

    split: str
    groups: int


def _split_counts(splits: Iterable[tuple[str, int]]) -> list[SplitCount]:
    return [SplitCount(split=name, groups=groups) for name, groups in splits]


class SplitLeakage(Document):
    """A match that lies in several splits."""

    match: str
    splits: Annotated[list[SplitCount], BeforeValidator(_split_counts)]


class YieldDocument(Document):
    """What a policy lets through, gate by gate."""

    policy: PolicyDocument = Field(description="The policy with which the groups are judged here.")
    groups: int
    passing: int
    unsolved: int = Field(description="Not solved yet under the present calibration.")
    funnel: list[FunnelStep] = Field(
        description="Every group by its first failing gate; the counts lead from all to passing."
    )
    given_not_measured: int = Field(
        description="Groups whose cameras are given and have no lines: gate `jac` passes them."
    )
    curves: list[CurveDocument]
    splits: list[SplitYield]
    distances: list[DistanceYield]
    findings: list[FindingYield]
    leakage: list[SplitLeakage]
    gained: int = Field(description="Groups that pass and do not under the present policy.")
    lost: int = Field(description="Groups that pass under the present policy and do not here.")
    needs_solving: list[str] = Field(
        description="Changed thresholds whose effect is known only after solving again."
    )


@router.get("", response_model=YieldDocument)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(COMPUTE)
def get_yield(dataset: DatasetPath, services: AppServices) -> Yield:
    """The yield of the policy: funnel, curves, splits, distances, leakage.

    What the answer is counted from is kept and follows every change. Where more than twenty
    thousand groups have changed since somebody looked, they are read first: until then the answer
    is 503, and says how far it is.
    """
    found = dataset_id(services.store, dataset)
    return count_yield(services.yields, found)


@router.post("", response_model=YieldDocument)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(COMPUTE)
def try_policy(dataset: DatasetPath, values: ThresholdsToTry, services: AppServices) -> Yield:
    """What other thresholds would let through; nothing is saved and nothing solved.

    The numbers are those that solving under these thresholds would give. `needs_solving` names
    the fields for which that cannot be known before.
    """
    found = dataset_id(services.store, dataset)
    return count_yield(services.yields, found, values.to_policy_values())
