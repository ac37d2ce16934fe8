"""Kernels: what is compiled leaves the interpreter to others while it runs."""

from __future__ import annotations

from types import ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

from app.geometry import (
    curve_fit,
    curve_residuals,
    damped_solve,
    lens_kernels,
    likely_point,
    point_kernels,
    smallest_singular,
    start_kernels,
)


@pytest.mark.parametrize(
    "module",
    [
        curve_fit,
        curve_residuals,
        damped_solve,
        lens_kernels,
        likely_point,
        point_kernels,
        smallest_singular,
        start_kernels,
    ],
)
def test_who_solves_keeps_nobody_from_being_answered(module: ModuleType) -> None:
    kernels = [item for item in vars(module).values() if isinstance(item, Dispatcher)]
    assert kernels
    assert all(item.targetoptions.get("nogil") for item in kernels)
