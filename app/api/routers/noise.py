"""Noise: how far clicks of a dataset are off, as its own residuals tell."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import AppServices, DatasetPath
from app.api.problem import responses
from app.api.schemas.noise import NoiseDocument
from app.review.policies.noise import Noise

router = APIRouter(prefix="/datasets/{dataset}/noise", tags=["policies"])


@router.get("", operation_id="getNoise", response_model=NoiseDocument, responses=responses(404))
def get_noise(dataset: DatasetPath, services: AppServices) -> Noise:
    """Sigma of balls, given cameras and field lines with intervals, and what the policy says.

    Changes nothing: to judge by the estimates, send `values` to the dataset's policy.
    """
    return services.noises.read(dataset)
