"""Datasets: what there is, how far it is, how its numbers are spread, and what judges it."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path

from app.api.deps import Actor, AppServices, AppStore, QueryText
from app.api.policies import choose_policy
from app.api.problem import responses
from app.api.schemas.dataset import DatasetDocument, DatasetList, SummaryDocument
from app.api.schemas.policy import PolicyEdit
from app.review import datasets as review
from app.review.progress import summary

router = APIRouter(prefix="/datasets", tags=["datasets"])

DatasetPath = Annotated[str, Path(max_length=200, description="Name or id of the dataset.")]


@router.get("", operation_id="listDatasets", responses=responses())
def list_datasets(store: AppStore) -> DatasetList:
    """Every dataset with its progress."""
    return DatasetList(items=[DatasetDocument.of(item) for item in review.list_datasets(store)])


@router.get("/{dataset}", operation_id="getDataset", responses=responses(404))
def get_dataset(dataset: DatasetPath, store: AppStore) -> DatasetDocument:
    """One dataset by name or id."""
    return DatasetDocument.of(review.get_dataset(store, dataset))


@router.get("/{dataset}/summary", operation_id="getSummary", responses=responses(404))
def get_summary(dataset: DatasetPath, store: AppStore, query: QueryText = "") -> SummaryDocument:
    """Progress and histograms over the groups that a query matches."""
    found = review.get_dataset(store, dataset)
    return SummaryDocument.of(summary(store, found.id, query))


@router.put("/{dataset}/policy", operation_id="setPolicy", responses=responses(404, 413, 415))
def put_policy(
    dataset: DatasetPath, policy: PolicyEdit, services: AppServices, actor: Actor
) -> DatasetDocument:
    """Judge the dataset by another policy.

    Needs no If-Match: it replaces the whole policy, so the last one counts. What is left without
    a solution is stale and solved in the background; `solved` of the dataset follows.
    """
    chosen = choose_policy(services.store, dataset, policy.name, actor=actor)
    services.recompute.request(chosen.name)
    return DatasetDocument.of(chosen)
