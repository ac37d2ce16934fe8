"""Every table: whoever needs the whole schema imports ``Base`` from here."""

from __future__ import annotations

from app.store import agreement_models as agreement_models
from app.store import change_models as change_models
from app.store import installation as installation
from app.store import job_models as job_models
from app.store import people_models as people_models
from app.store import pitch_models as pitch_models
from app.store import prediction_models as prediction_models
from app.store import proposal_models as proposal_models
from app.store import take_models as take_models
from app.store import talk_models as talk_models
from app.store import version_models as version_models
from app.store import view_models as view_models
from app.store import webhook_models as webhook_models
from app.store import work_models as work_models
from app.store.models import Base as Base
