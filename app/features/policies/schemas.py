"""A policy as it travels: every threshold, its name and its hash."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import AliasPath, Field, create_model

from app.features.policies.service import (
    MAX_CHARACTERS,
    PolicyState,
    policy_to_values,
    policy_to_yaml,
)
from app.http.documents import Document, ListDocument, RequestBody
from app.soccer.policy import CalibrationPolicy, Policy
from app.soccer.thresholds import Asks, list_thresholds


class _PolicyIdentity(Document):
    name: str
    hash: str = Field(description="Digest of every value but the name.")
    calibration: CalibrationPolicy = Field(description="What a view's calibration depends on.")


_thresholds: dict[str, Any] = {
    item.name: (item.hint, Field(description=item.label_with_unit))
    for item in list_thresholds(Policy)
}
_PolicyFields: Any = create_model("_PolicyFields", __base__=_PolicyIdentity, **_thresholds)


class PolicyDocument(_PolicyFields):
    """All thresholds; per cent are of the image diagonal."""


class PolicyChange(
    RequestBody,
    examples=[
        {"name": "strict"},
        {"name": "tight", "values": {"tau_percent": 0.5}},
        {"yaml": "name: tight\ntau_percent: 0.5\n"},
    ],
):
    """The policy that a dataset shall be judged by: a name, thresholds, or a YAML text."""

    name: str | None = Field(
        default=None,
        min_length=1,
        max_length=80,
        description="Name of the new policy. The name of a shipped policy alone chooses that one.",
    )
    values: dict[str, Any] | None = Field(
        default=None,
        description="Thresholds that differ from the present policy; those of `calibration` are "
        "nested in it.",
    )
    yaml: str | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_CHARACTERS,
        description="A whole policy, and nothing else beside it; what it does not name is as in "
        "`paper`.",
    )


class PolicyVersionDocument(Document):
    """A policy that judged the dataset from some time on."""

    version: int
    name: str = Field(validation_alias=AliasPath("policy", "name"))
    hash: str = Field(validation_alias=AliasPath("policy", "hash"))
    at: datetime
    actor: str


class PolicyStateDocument(Document):
    """What judges a dataset, and what did before; the newest version last."""

    dataset: str
    etag: str
    version: int
    name: str
    hash: str
    values: dict[str, Any] = Field(
        description="Every threshold by name; those of the calibration's part in `calibration`."
    )
    yaml: str = Field(description="The whole policy as YAML, to be kept in a file.")
    history: list[PolicyVersionDocument]

    @staticmethod
    def of(state: PolicyState) -> PolicyStateDocument:
        """The document of a dataset's policy."""
        return PolicyStateDocument(
            dataset=state.dataset,
            etag=state.etag,
            version=state.version,
            history=state.history,
            **_policy_fields(state.policy),
        )


class ShippedPolicyDocument(Document):
    """A policy that comes with the software."""

    name: str
    hash: str
    values: dict[str, Any]
    yaml: str

    @staticmethod
    def of(policy: Policy) -> ShippedPolicyDocument:
        """The document of a shipped policy."""
        return ShippedPolicyDocument(**_policy_fields(policy))


class PolicyFieldDocument(Document):
    """What a threshold is called and between which ends it lies, for forms."""

    name: str = Field(
        description="Name of the threshold; those of the calibration begin with `calibration.`."
    )
    label: str
    unit: str
    default: float | bool | str | None = Field(
        description="Value in the policy `paper`; null: the threshold is off."
    )
    minimum: float | None
    maximum: float | None
    choices: list[float | str] = Field(
        description="Values to offer; empty: any between the ends. Where they are words, there are "
        "no others."
    )
    gate: str | None = Field(description="The gate that asks for it.")
    comparison: Asks | None = Field(
        description="How a value compares with it to pass. What equals a threshold passes, but for "
        "`more than`: JaC must exceed it, as in the paper."
    )
    optional: bool = Field(description="Whether it can be null.")


class PolicyCatalogue(ListDocument[ShippedPolicyDocument]):
    """The policies that come with the software, and every threshold there is."""

    fields: list[PolicyFieldDocument]


def _policy_fields(policy: Policy) -> dict[str, Any]:
    return {
        "name": policy.name,
        "hash": policy.hash,
        "values": policy_to_values(policy),
        "yaml": policy_to_yaml(policy),
    }
