"""Every table: whoever needs the whole schema imports ``Base`` from here."""

from __future__ import annotations

from app.store import installation as installation
from app.store import job_models as job_models
from app.store import people_models as people_models
from app.store import pitch_models as pitch_models
from app.store import prediction_models as prediction_models
from app.store import proposal_models as proposal_models
from app.store import version_models as version_models
from app.store import view_models as view_models
from app.store.models import Base as Base
