# SPDX-License-Identifier: Apache-2.0
"""Types of the language, and what their values consist of."""

from ..model.types import SCALARS, Array, Scalar, Type, count_of, scalar_of, shape_of

__all__ = [
    "Array",
    "SCALARS",
    "Scalar",
    "Type",
    "count_of",
    "scalar_of",
    "shape_of",
]
