# SPDX-License-Identifier: Apache-2.0
"""Flies a compiled machine against plant models: checks `*.sim.json`, runs the native simulator (fcsl/fcsl_sim.h)."""

from .config import SimConfig, load
from .errors import SimError
from .native import Simulation

__all__ = ["SimConfig", "SimError", "Simulation", "load"]
