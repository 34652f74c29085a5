# SPDX-License-Identifier: Apache-2.0
"""The frequency response of second-order sections in series.

    H(z) = Π (b0 + b1·z⁻¹ + b2·z⁻²) / (1 + a1·z⁻¹ + a2·z⁻²),  z = exp(j·2π·f/rate)
    group delay = -d arg H / dω = Σ Re(B'/B) - Re(A'/A),  with P' = Σ k·p_k·z⁻ᵏ

J. O. Smith, Introduction to Digital Filters, "Numerical Computation of Group Delay".
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
_ORDERS = np.arange(3)


def response(sections: Sequence[Sequence[float]], rate_hz: float, hz: Array) -> tuple[Array, Array]:
    """Gain, a factor, and group delay in s at the frequencies, shape (N,). A section is [b0, b1, b2, a1, a2].

    Where the gain is 0 the group delay is NaN: the phase jumps there.
    """
    powers = np.exp(-2j * np.pi * np.outer(hz / rate_hz, _ORDERS))
    gain, samples = np.ones(len(hz)), np.zeros(len(hz))
    for section in sections:
        b, a = np.array(section[:3]), np.array([1.0, *section[3:]])
        gain *= abs(powers @ b) / abs(powers @ a)
        samples += _delay(b, powers) - _delay(a, powers)
    return gain, samples / rate_hz


def _delay(polynomial: Array, powers: NDArray[np.complexfloating[Any, Any]]) -> Array:
    """Of one polynomial in z⁻¹, in samples. NaN where it is 0, but for rounding."""
    value = powers @ polynomial
    known = abs(value) > 1e-12 * abs(polynomial).sum()
    delay = np.full(len(value), np.nan)
    delay[known] = np.real(powers[known] @ (_ORDERS * polynomial) / value[known])
    return delay
