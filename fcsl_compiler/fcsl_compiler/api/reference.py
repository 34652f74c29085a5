# SPDX-License-Identifier: Apache-2.0
"""The reference, which runs a machine in CPython, and what it needs of the compiler."""

from ..driver.externs import build_externs
from ..driver.monitors import compile_monitor
from ..driver.passes import compile_machine
from ..reference.externs import externs_of
from ..reference.fault_places import FaultRow
from ..reference.machine import EventRow, ReferenceMachine

__all__ = [
    "EventRow",
    "FaultRow",
    "ReferenceMachine",
    "build_externs",
    "compile_machine",
    "compile_monitor",
    "externs_of",
]
