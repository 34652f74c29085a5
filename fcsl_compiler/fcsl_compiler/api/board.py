# SPDX-License-Identifier: Apache-2.0
"""What boards consist of: drivers, kinds of sensors, rotations, pulses."""

from ..board.drivers import known_drivers
from ..board.kinds import KINDS
from ..board.pulses import Line
from ..board.rotations import IDENTITY, NAMED, from_angles, matrix_problem

__all__ = [
    "IDENTITY",
    "KINDS",
    "Line",
    "NAMED",
    "from_angles",
    "known_drivers",
    "matrix_problem",
]
