# SPDX-License-Identifier: Apache-2.0
"""Hard and soft iron of a compass, from a vehicle that is turned in all directions."""

from __future__ import annotations

import numpy as np

from .board_edit import Changes
from .board_file import Target
from .collect import Report, Source
from .describe import show_numbers
from .errors import Refused
from .fit_compass import CompassFit, fit_compass, turned_coverage
from .least_squares import Vector
from .rounding import rounded

SECONDS = 60.0
#: The field of the Earth has 22 to 67 uT; so much may be left of it, or added to it, in T.
_FIELD_MIN, _FIELD_MAX = 10e-6, 150e-6
_COVERAGE_MIN, _RESIDUAL_MAX = 0.75, 0.1
_SAMPLES_MIN = 50
#: What is shown meanwhile must not take the time for reading.
_SHOWN_MAX = 2000


def calibrate_compass(target: Target, seconds: float) -> Changes:
    """What changes in the backend. Raises Refused."""
    print(f"turn the vehicle about all its axes for {seconds:g} s, away from iron and cables", flush=True)
    taken: list[Vector] = []
    report = Report()
    with Source(target, "field") as source:
        for at, vector in source.vectors(seconds):
            taken.append(vector)
            if report.is_due(at):
                some = np.array(taken[:: max(1, len(taken) // _SHOWN_MAX)])
                report.at(at, f"{at:.0f} s: {100 * turned_coverage(some, _FIELD_MIN):.0f} % of all directions")
    report.end()
    if len(taken) < _SAMPLES_MIN:
        raise Refused(f"only {len(taken)} samples came in {seconds:g} s: at least {_SAMPLES_MIN} are needed")
    fit = _checked(fit_compass(np.array(taken)))
    print(f"hard iron {show_numbers(fit.offset * 1e6)} uT, field {fit.field * 1e6:.3g} uT")
    print("soft iron " + ", ".join(show_numbers(row, 4) for row in fit.matrix))
    print(
        f"coverage {100 * fit.coverage:.0f} %, residual {100 * fit.residual:.2g} % of the field, {len(taken)} samples"
    )
    return {"correct": {"field": {"offset": rounded(fit.offset), "scale": rounded(fit.matrix)}}}


def _checked(fit: CompassFit | None) -> CompassFit:
    if fit is None:
        raise Refused("the readings lie on no ellipsoid: turn the vehicle about all its axes")
    if not _FIELD_MIN <= fit.field <= _FIELD_MAX:
        raise Refused(
            f"the readings lie on a sphere of {fit.field * 1e6:.3g} uT, and the Earth's field has 22 to 67 uT: was the vehicle "
            "turned, and is the device's unit T?"
        )
    if fit.coverage < _COVERAGE_MIN:
        raise Refused(
            f"the readings cover {100 * fit.coverage:.0f} % of all directions, and {100 * _COVERAGE_MIN:.0f} % are needed: turn "
            "the vehicle about all its axes"
        )
    if fit.residual > _RESIDUAL_MAX:
        raise Refused(
            f"the readings are {100 * fit.residual:.2g} % of the field off the sphere, at most {100 * _RESIDUAL_MAX:.0f} % may be: "
            "is iron near, or a current?"
        )
    return fit
