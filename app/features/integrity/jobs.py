"""Examination: a whole home, its files, its database and what people said and froze in it."""

from __future__ import annotations

from contextlib import closing

from app.config import Settings
from app.db.check import Check
from app.db.home import make_home
from app.db.store import Store
from app.errors import StorageError
from app.features.comments.check import examine_threads
from app.features.integrity.database import examine
from app.features.integrity.home import examine_home, examine_surroundings
from app.features.versions.check import examine_versions
from app.features.what_if.service import examine_yields


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
