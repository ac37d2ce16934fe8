"""Gold groups: groups whose truth is known, and how far people are from it."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.api.deps import Actor, AppStore, DatasetPath, Id
from app.api.problem import responses
from app.api.reply import AskedUnder, Reply, document
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
def choose(
    dataset: DatasetPath,
    choice: GoldChoiceDocument,
    store: AppStore,
    actor: Actor,
    asked: AskedUnder,
) -> Response:
    """Make gold groups of those whose truth is known, also while batches are under way."""
    values = choice.model_dump(exclude={"q", "source"})
    wanted = GoldChoice(gold.TruthSource(choice.source), query=choice.q, **values)
    reply = Reply[GoldChosen](
        asked, lambda chosen: document(GoldChosenDocument.model_validate(chosen))
    )
    return reply.of(mark_known(store, dataset, wanted, actor=actor, keep=reply.keep))


@router.put(
    "/groups/{group}/gold",
    operation_id="markGold",
    response_model=GoldGroupDocument,
    responses=responses(404, 409, 413, 415),
)
def mark(group: Id, edit: GoldEdit, store: AppStore, actor: Actor, asked: AskedUnder) -> Response:
    """Say that what a group holds now, with its verdict, is true."""
    reply = Reply(asked, _gold_answer)
    return reply.of(gold.mark(store, group, edit.start, actor=actor, keep=reply.keep))


@router.patch(
    "/groups/{group}/gold",
    operation_id="changeGold",
    response_model=GoldGroupDocument,
    responses=responses(404, 413, 415),
)
def change(group: Id, edit: GoldEdit, store: AppStore, actor: Actor, asked: AskedUnder) -> Response:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    reply = Reply(asked, _gold_answer)
    return reply.of(gold.start_with(store, group, edit.start, actor=actor, keep=reply.keep))


@router.delete(
    "/groups/{group}/gold",
    operation_id="unmarkGold",
    response_model=GoldGroupDocument,
    responses=responses(404),
)
def unmark(group: Id, store: AppStore, actor: Actor, asked: AskedUnder) -> Response:
    """Let a gold group be an ordinary one again; what people made of it is no longer shown."""
    reply = Reply(asked, _gold_answer)
    return reply.of(gold.unmark(store, group, actor=actor, keep=reply.keep))


def _gold_answer(group: gold.GoldGroup) -> Response:
    return document(GoldGroupDocument.model_validate(group))
