"""A static camera as it travels."""

from __future__ import annotations

from pydantic import BaseModel, Field

from app.features.groups.schemas import DatasetName, LineDocuments, lines_document
from app.features.stations.service import StationState
from app.soccer.choices import CalibrationChoice


class StationDetail(BaseModel):
    """A camera station: the lines that all its views share."""

    id: int
    dataset: DatasetName
    key: str
    shared: bool
    width: int
    height: int
    calibration: CalibrationChoice
    has_given: bool
    has_given_covariance: bool = Field(
        description="Whether its given camera says how far it may be off; an accepted rig does."
    )
    flipped: bool
    lines: LineDocuments
    proposed: list[str] = Field(
        description="Markings whose points were accepted as they were proposed from the paint."
    )
    not_visible: list[str] = Field(
        description="Markings that a person says its pictures do not show: JaC does not count them."
    )
    groups: int = Field(description="How many groups it takes part in.")
    revision: int
    etag: str
    can_undo: bool
    can_redo: bool

    @staticmethod
    def of(state: StationState) -> StationDetail:
        """The document of a station's state."""
        station = state.station
        return StationDetail.model_validate(
            {
                **vars(station),
                **vars(state),
                **vars(station.size),
                "dataset": DatasetName(id=state.dataset_id, name=state.dataset),
                "has_given": station.given is not None,
                "has_given_covariance": station.given_covariance is not None,
                "lines": lines_document(station.lines),
                "groups": len(state.groups),
            }
        )
