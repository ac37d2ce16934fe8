"""Examination: a whole home, its files, its database and what people said and froze in it."""

from __future__ import annotations

from contextlib import closing

from app.config import Settings
from app.errors import StorageError
from app.review.doctor.check import Check
from app.review.doctor.database import examine
from app.review.doctor.home import examine_home, examine_surroundings
from app.review.talk.check import examine_threads
from app.review.versions.check import examine_versions
from app.review.yields.check import examine_yields
from app.store.home import make_home
from app.store.store import Store


def examine_everything(settings: Settings) -> list[Check]:
    """Look at everything; where the database cannot be opened, say why, and what lies around it."""
    make_home(settings)
    checks = [*examine_home(settings), examine_yields(settings)]
    try:
        with closing(Store.open(settings)) as store:
            checks += [*examine_surroundings(store), *examine(store)]
            return [*checks, examine_threads(store), *examine_versions(store)]
    except StorageError as error:
        return [*checks, Check("database", False, error.message, error.hint)]
