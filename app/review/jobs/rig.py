"""The job that adjusts the static cameras of a dataset: it proposes, and saves what is accepted."""

from __future__ import annotations

from app.errors import ConflictError
from app.review.datasets.dataset import get_dataset_head
from app.review.editing.rig import accept, adjustable, proposal_values, propose, take_back
from app.review.idempotency import without_response
from app.review.jobs.jobs import Jobs
from app.review.jobs.run import JobProgress, Work
from app.review.jobs.solve import request_solve
from app.store.jobs import Job
from app.store.store import Store
from app.store.stored_json import Json

KIND = "rig"


def request_rig(
    jobs: Jobs, store: Store, dataset: str, *, what: str | None, inputs: str | None, actor: str
) -> Job:
    """Adjust the static cameras of a dataset, soon; what can be refused is refused at once.

    Args:
        jobs: Where it is queued.
        store: The database.
        dataset: Name or id.
        what: What of the proposal is saved, as ``editing.rig.accept`` takes it; None: nothing.
        inputs: Of the proposal that a person saw; no other one is saved.
        actor: Who wants it.

    Raises:
        InputError, ConflictError: As ``editing.rig.adjustable`` does.
    """
    found = get_dataset_head(store, dataset)
    adjustable(store, found.id)
    return jobs.submit(
        KIND,
        f"Adjust the cameras of {found.name}",
        rig_work(jobs, store, found.id, what, inputs, actor),
        dataset_id=found.id,
        actor=actor,
        request={"what": what, "inputs": inputs},
    )


def make_rigs(jobs: Jobs, store: Store) -> None:
    """Let another process adjust the cameras than the one that was asked."""

    def work_of(job: Job) -> Work:
        what, inputs = job.request["what"], job.request["inputs"]
        return rig_work(jobs, store, job.dataset_id or 0, what, inputs, job.actor)

    jobs.makes(KIND, work_of)


def take_rig_back(jobs: Jobs, store: Store, dataset: str, *, actor: str) -> int:
    """Take an accepted rig back, and solve its dataset, soon; returns the number of cameras.

    Raises:
        ConflictError: There is nothing to take back.
    """
    found = get_dataset_head(store, dataset)
    count = take_back(store, found.id, actor=actor)
    with without_response():
        request_solve(jobs, store, found.id, actor=actor)
    return count


def rig_work(
    jobs: Jobs, store: Store, dataset_id: int, what: str | None, inputs: str | None, actor: str
) -> Work:
    """The work itself; its result is the proposal and what of it was saved."""

    def work(progress: JobProgress) -> Json:
        progress(0, None, "Adjusting cameras to lines and balls.")
        with jobs.pool() as executor:
            proposed = propose(store, dataset_id, executor=executor)
        progress.check()
        if what is not None:
            if inputs != proposed.inputs:
                raise ConflictError(
                    "balls, lines or cameras have changed since that proposal",
                    hint="Look at a new one, and accept that.",
                )
            accept(store, proposed, what, actor=actor)
            request_solve(jobs, store, dataset_id, actor=actor)
        return {**proposal_values(proposed), "accepted": what}

    return work
