"""Gold groups: groups whose truth is known, and how far people are from it."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import Actor, AppStore, DatasetPath, Id
from app.api.problem import responses
from app.api.respond import as_document, responds
from app.api.schemas.take import (
    GoldChoiceDocument,
    GoldChosenDocument,
    GoldEdit,
    GoldGroupDocument,
    GoldReportDocument,
)
from app.review.takes import gold
from app.review.takes.known_truth import GoldChoice, GoldChosen, mark_known

router = APIRouter(tags=["takes"])


@router.get(
    "/datasets/{dataset}/gold",
    operation_id="getGoldReport",
    response_model=GoldReportDocument,
    responses=responses(404),
)
def get_report(dataset: DatasetPath, store: AppStore) -> gold.GoldReport:
    """The gold groups of a dataset, and what each person made of those that they were given."""
    return gold.read_report(store, dataset)


@router.post(
    "/datasets/{dataset}/gold",
    operation_id="chooseGoldGroups",
    response_model=GoldChosenDocument,
    responses=responses(404, 409, 413, 415),
)
@responds(as_document(GoldChosenDocument.model_validate))
def choose(
    dataset: DatasetPath, choice: GoldChoiceDocument, store: AppStore, actor: Actor
) -> GoldChosen:
    """Make gold groups of those whose truth is known, also while batches are under way."""
    values = choice.model_dump(exclude={"q", "source"})
    wanted = GoldChoice(gold.TruthSource(choice.source), query=choice.q, **values)
    return mark_known(store, dataset, wanted, actor=actor)


@router.put(
    "/groups/{group}/gold",
    operation_id="markGold",
    response_model=GoldGroupDocument,
    responses=responses(404, 409, 413, 415),
)
@responds(as_document(GoldGroupDocument.model_validate))
def mark(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Say that what a group holds now, with its verdict, is true."""
    return gold.mark(store, group, edit.start, actor=actor)


@router.patch(
    "/groups/{group}/gold",
    operation_id="changeGold",
    response_model=GoldGroupDocument,
    responses=responses(404, 413, 415),
)
@responds(as_document(GoldGroupDocument.model_validate))
def change(group: Id, edit: GoldEdit, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    return gold.start_with(store, group, edit.start, actor=actor)


@router.delete(
    "/groups/{group}/gold",
    operation_id="unmarkGold",
    response_model=GoldGroupDocument,
    responses=responses(404),
)
@responds(as_document(GoldGroupDocument.model_validate))
def unmark(group: Id, store: AppStore, actor: Actor) -> gold.GoldGroup:
    """Let a gold group be an ordinary one again; what people made of it is no longer shown."""
    return gold.unmark(store, group, actor=actor)
