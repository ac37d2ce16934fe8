"""The pitch: marking names and shapes, for drawing and for scripts."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.problem import responses
from app.api.schemas.pitch import PitchDocument
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Pitch

router = APIRouter(tags=["pitch"])


@router.get("/pitch", operation_id="getPitch", responses=responses())
def get_pitch(
    length: Annotated[float, Query(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])] = 105.0,
    width: Annotated[float, Query(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])] = 68.0,
) -> PitchDocument:
    """The 26 markings of a pitch of that size."""
    return PitchDocument.of(Pitch(length, width))
