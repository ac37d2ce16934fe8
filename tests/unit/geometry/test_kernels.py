"""Kernels: what is compiled leaves the interpreter to others while it runs."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

import pytest
from numba.core.dispatcher import Dispatcher

from app import geometry

KERNELS = {
    f"{module.name}.{name}": value
    for module in iter_modules(geometry.__path__)
    for name, value in vars(import_module(f"{geometry.__name__}.{module.name}")).items()
    if isinstance(value, Dispatcher)
}


def test_kernels_of_several_modules_are_found() -> None:
    assert {
        "resection_kernels.minimize_curve_costs",
        "curve_residuals.accumulate_equations",
        "polyline.find_nearest_places",
    } <= set(KERNELS)


@pytest.mark.parametrize("name", KERNELS)
def test_who_solves_keeps_nobody_from_being_answered(name: str) -> None:
    assert KERNELS[name].targetoptions.get("nogil")
