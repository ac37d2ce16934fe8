"""Yields: what a dataset's policy lets through, and what another one would."""

from __future__ import annotations

from fastapi import APIRouter

from app.features.datasets.service import dataset_id
from app.features.what_if.funnel import Yield, get_yield
from app.features.what_if.schemas import WhatIf, YieldDocument
from app.http.deps import AppServices, DatasetPath
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import QUESTIONS, limit
from app.http.route import Route

router = APIRouter(prefix="/datasets/{dataset}/yield", tags=["yield"], route_class=Route)


@router.get("", operation_id="getYield", response_model=YieldDocument, responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(QUESTIONS)
def read_yield(dataset: DatasetPath, services: AppServices) -> Yield:
    """What the policy lets through: funnel, curves, splits, distances, leakage.

    What the answer is counted from is kept and follows every change. Where more than twenty
    thousand groups have changed since somebody looked, they are read first: until then the answer
    is 503, and says how far it is.
    """
    found = dataset_id(services.store, dataset)
    return get_yield(services.yields, found)


@router.post(
    "", operation_id="tryPolicy", response_model=YieldDocument, responses=responses(404, 413, 415)
)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(QUESTIONS)
def try_policy(dataset: DatasetPath, values: WhatIf, services: AppServices) -> Yield:
    """What other thresholds would let through; nothing is saved and nothing solved.

    The numbers are those that solving under these thresholds would give. `needs_solving` names
    the fields for which that cannot be known before.
    """
    found = dataset_id(services.store, dataset)
    return get_yield(services.yields, found, values.values())
