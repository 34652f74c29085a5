# SPDX-License-Identifier: Apache-2.0
"""The offset of a gyro, from a vehicle at rest."""

from __future__ import annotations

import numpy as np

from .board_edit import Changes
from .board_file import Target
from .collect import Report, Source
from .describe import show_numbers
from .errors import Refused
from .fit_still import Still, fit_still
from .rounding import rounded

SECONDS = 10.0
#: Of an axis, in rad/s: noise is below, hands are above.
_DEVIATION_MAX = 0.02
#: Beyond the offset of any gyro that works, in rad/s: the vehicle turns.
_OFFSET_MAX = 0.5
_SAMPLES_MIN = 20


def calibrate_gyro(target: Target, seconds: float) -> Changes:
    """What changes in the backend. Raises Refused."""
    print(f"keep the vehicle still for {seconds:g} s", flush=True)
    taken, report = [], Report()
    with Source(target, "gyro") as source:
        for at, vector in source.vectors(seconds):
            taken.append(vector)
            report.at(at, f"{at:.0f} s: {len(taken)} samples")
    report.end()
    if len(taken) < _SAMPLES_MIN:
        raise Refused(f"only {len(taken)} samples came in {seconds:g} s: at least {_SAMPLES_MIN} are needed")
    still = fit_still(np.array(taken))
    _check(still)
    mean, deviation = show_numbers(still.mean), show_numbers(still.deviation, 2)
    print(f"offset {mean} rad/s, standard deviation {deviation} rad/s, of {len(taken)} samples")
    return {"correct": {"gyro": {"offset": rounded(still.mean)}}}


def _check(still: Still) -> None:
    axis = int(still.deviation.argmax())
    if still.deviation[axis] > _DEVIATION_MAX:
        raise Refused(
            f"it moved: the standard deviation of {'xyz'[axis]} is {still.deviation[axis]:.3g} rad/s, and at rest at most "
            f"{_DEVIATION_MAX:g}"
        )
    axis = int(np.abs(still.mean).argmax())
    if abs(still.mean[axis]) > _OFFSET_MAX:
        raise Refused(
            f"it turns: {'xyz'[axis]} has {still.mean[axis]:.3g} rad/s, and no gyro is off by {_OFFSET_MAX:g}"
        )
