"""Policies: those that are shipped, the one that judges a dataset, and the change to another."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.errors import InputError
from app.features.jobs.schemas import JobDocument, make_location_header
from app.features.policies.schemas import (
    PolicyCatalogue,
    PolicyChange,
    PolicyStateDocument,
    ShippedPolicyDocument,
)
from app.features.policies.service import (
    CUSTOM,
    policy_from_yaml,
    read_policy,
    replace_thresholds,
    unknown_policy_error,
)
from app.features.solve.jobs import PolicyStateAndJob, request_policy_change
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, IfMatch
from app.http.documents import make_document_response, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import Responses
from app.http.route import Route
from app.soccer.policy import POLICIES, Policy
from app.soccer.thresholds import THRESHOLDS

router = APIRouter(tags=["policies"], route_class=Route)

TAGGED = {"ETag": {"description": "The policy's state.", "schema": {"type": "string"}}}
LOCATED = {"Location": {"description": "Of the job.", "schema": {"type": "string"}}}
CHANGED: Responses = {
    202: {
        "description": "The job that solves what the policy left stale.",
        "headers": {**TAGGED, **LOCATED},
    }
}


@router.get("/policies")
@may(Action.READ, where=RoleScope.SOMEWHERE)
@paged()
def list_policies() -> PolicyCatalogue:
    """The policies that come with the software, and what can be set in one."""
    return PolicyCatalogue(
        items=[ShippedPolicyDocument.of(policy) for policy in POLICIES.values()],
        fields=THRESHOLDS,
    )


@router.get("/datasets/{dataset}/policy", responses={200: {"headers": TAGGED}})
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_policy(dataset: DatasetPath, store: AppStore, response: Response) -> PolicyStateDocument:
    """The policy of the dataset, and its earlier versions."""
    policy = PolicyStateDocument.of(read_policy(store, dataset))
    response.headers.update(_make_etag_headers(policy))
    return policy


def _make_policy_change_response(judged: PolicyStateAndJob) -> Response:
    policy, job = PolicyStateDocument.of(judged.state), JobDocument.model_validate(judged.job)
    job.result = {"policy": policy.model_dump(mode="json"), "to_solve": judged.to_solve}
    return make_document_response(
        job, 202, {**_make_etag_headers(policy), **make_location_header(judged.job)}
    )


@router.put(
    "/datasets/{dataset}/policy", status_code=202, response_model=JobDocument, responses=CHANGED
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(_make_policy_change_response)
def set_policy(
    dataset: DatasetPath,
    change: PolicyChange,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> PolicyStateAndJob:
    """Judge the dataset by another policy.

    What that leaves without a solution is stale and solved by the job; `result.policy` of the
    answer is the policy as it is now, `result.to_solve` how many groups are solved again. Only another calibration part calibrates anything anew.
    """
    store = services.store
    present = read_policy(store, dataset)
    policy = build_requested_policy(change, present.policy)
    with add_current_state_to_conflicts(
        lambda: PolicyStateDocument.of(read_policy(store, dataset))
    ):
        return request_policy_change(
            services.jobs, store, present.dataset_id, policy, if_match=if_match, actor=actor
        )


def build_requested_policy(change: PolicyChange, present: Policy) -> Policy:
    """The policy that a request asks for.

    Raises:
        InputError: It asks for nothing, for two things, or for what cannot be.
    """
    if change.yaml is not None:
        if change.name is not None or change.values is not None:
            raise InputError(
                "send a YAML text alone, without a name and without thresholds", pointer="/yaml"
            )
        try:
            return policy_from_yaml(change.yaml)
        except InputError as error:
            raise InputError(error.message, hint=error.hint, pointer="/yaml") from error
    if change.name is None and change.values is None:
        raise InputError("name a policy, give thresholds, or send a YAML text")
    if not change.values and change.name in POLICIES:
        return POLICIES[change.name]
    if not change.values and change.name != present.name:
        raise unknown_policy_error(change.name or "", "the request has no values", pointer="/name")
    # A shipped policy with another threshold is no longer the one of that name.
    name = change.name or (CUSTOM if present.name in POLICIES else present.name)
    return replace_thresholds(present, change.values or {}, name=name, pointer="/values")


def _make_etag_headers(policy: PolicyStateDocument) -> dict[str, str]:
    return {"ETag": policy.etag, "Cache-Control": "private, no-cache"}
