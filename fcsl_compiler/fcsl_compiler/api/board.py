# SPDX-License-Identifier: Apache-2.0
"""What boards consist of: kinds of sensors, rotations, pulses."""

from ..board.kinds import KINDS
from ..board.pulses import Line
from ..board.rotations import IDENTITY, NAMED, from_angles, matrix_problem

__all__ = [
    "IDENTITY",
    "KINDS",
    "Line",
    "NAMED",
    "from_angles",
    "matrix_problem",
]
