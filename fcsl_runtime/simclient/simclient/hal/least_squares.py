# SPDX-License-Identifier: Apache-2.0
"""Nonlinear least squares: Gauss-Newton steps, halved until they help."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
#: Residuals of n points, and their n × k derivatives by the k parameters.
Model = Callable[[Vector], tuple[Vector, Vector]]

_STEPS_MAX, _HALVINGS_MAX = 100, 30
_TOLERANCE = 1e-12


def minimize(model: Model, start: Vector) -> Vector:
    """The parameters near `start` with the smallest sum of squared residuals. Parameters should be of one size."""
    parameters = start
    residuals, derivatives = model(parameters)
    for _ in range(_STEPS_MAX):
        step = np.linalg.lstsq(derivatives, -residuals, rcond=None)[0]
        for _ in range(_HALVINGS_MAX):
            tried = model(parameters + step)
            if np.isfinite(tried[0]).all() and tried[0] @ tried[0] <= residuals @ residuals:
                break
            step = step / 2.0
        else:
            return parameters
        parameters = parameters + step
        residuals, derivatives = tried
        if np.abs(step).max() <= _TOLERANCE * max(1.0, np.abs(parameters).max()):
            return parameters
    return parameters
