# SPDX-License-Identifier: Apache-2.0
"""Times in s, as the exact decimals that were written, in ticks."""

from __future__ import annotations

from fractions import Fraction

from fcsl_compiler.api.sections import nearest_seconds, seconds


def whole_ticks(time_s: Fraction, tick_hz: int) -> int:
    """The ticks of a time. Raises ValueError, which says which times are near, where it is not a whole number of them."""
    ticks = time_s * tick_hz
    if ticks.denominator != 1:
        near = " or ".join(nearest_seconds(ticks, tick_hz))
        raise ValueError(
            f"{seconds(time_s.numerator, time_s.denominator)} s is not a whole number of ticks (1/{tick_hz} s); write {near}"
        )
    return ticks.numerator
