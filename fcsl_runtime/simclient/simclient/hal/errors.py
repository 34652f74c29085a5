# SPDX-License-Identifier: Apache-2.0
"""What ends a command of fcsl hal with exit status 1: something is not as it should be."""

from __future__ import annotations


class Refused(ValueError):
    """A device that is not there or does not answer, or a calibration or a movement that is refused. The message says why."""
