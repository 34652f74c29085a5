# SPDX-License-Identifier: Apache-2.0
"""Flies a compiled machine against plant models: checks `*.sim.json`, runs the native simulator (fcsl/fcsl_sim.h)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .config import SimConfig, load
    from .errors import SimError
    from .native import Simulation

#: Where each name is. It is imported on first use: the help of `fcsl-sim` needs none.
_HOME = {"SimConfig": "config", "SimError": "errors", "Simulation": "native", "load": "config"}

__all__ = ["SimConfig", "SimError", "Simulation", "load"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(f".{_HOME[name]}", __name__), name)
    return found
