"""Every table: what people said, its append-only log, and what was computed from it.

``dataset``, ``station``, ``groups`` and ``view`` hold the present state of what was said; the
``log`` can rebuild them. ``verdict``, ``dismissal`` and ``log`` only grow, ``solution`` and ``calibration`` are
inserted and never changed (triggers see to it). ``queue`` is a projection of all of these, one
row a group. Whoever imports one table has the whole schema in ``Base``.
"""

from __future__ import annotations

from app.store.tables import agreement as agreement
from app.store.tables import changes as changes
from app.store.tables import dismissals as dismissals
from app.store.tables import groups as groups
from app.store.tables import installation as installation
from app.store.tables import jobs as jobs
from app.store.tables import log as log
from app.store.tables import people as people
from app.store.tables import pitches as pitches
from app.store.tables import predictions as predictions
from app.store.tables import proposals as proposals
from app.store.tables import queue as queue
from app.store.tables import saved_views as saved_views
from app.store.tables import solutions as solutions
from app.store.tables import takes as takes
from app.store.tables import talk as talk
from app.store.tables import verdicts as verdicts
from app.store.tables import versions as versions
from app.store.tables import webhooks as webhooks
from app.store.tables import work as work
from app.store.tables.base import Base as Base
