"""Every table: what people said, its append-only log, and what was computed from it.

``dataset``, ``station``, ``groups`` and ``view`` hold the present state of what was said; the
``log`` can rebuild them. ``verdict``, ``dismissal`` and ``log`` only grow, ``solution`` and ``calibration`` are
inserted and never changed (triggers see to it). ``queue`` is a projection of all of these, one
row a group. Who needs all tables imports ``Base`` from here: that of ``db.session`` knows those alone
that have been imported.
"""

from __future__ import annotations

from app.db import idempotency  # noqa: F401
from app.db.session import Base as Base
from app.features.agreement import queries as agreement  # noqa: F401
from app.features.batches import tables as batches  # noqa: F401
from app.features.comments import queries as comments  # noqa: F401
from app.features.datasets import tables as datasets  # noqa: F401
from app.features.findings import queries as findings  # noqa: F401
from app.features.independent_annotations import tables as independent_annotations  # noqa: F401
from app.features.jobs import queries as jobs  # noqa: F401
from app.features.paint import queries as paint  # noqa: F401
from app.features.people import login_queries  # noqa: F401
from app.features.people import tables as people  # noqa: F401
from app.features.pitches import queries as pitches  # noqa: F401
from app.features.predictions import tables as predictions  # noqa: F401
from app.features.queue import tables as queue  # noqa: F401
from app.features.recordings import tables as recordings  # noqa: F401
from app.features.saved_views import queries as saved_views  # noqa: F401
from app.features.solutions import queries as solutions  # noqa: F401
from app.features.tracks import tables as tracks  # noqa: F401
from app.features.verdicts import tables as verdicts  # noqa: F401
from app.features.versions import queries as versions  # noqa: F401
from app.features.webhooks import tables as webhooks  # noqa: F401
