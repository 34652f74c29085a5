# SPDX-License-Identifier: Apache-2.0
"""Offsets between the time scales of clocks, by which stamps of another clock are recognised."""

from __future__ import annotations

#: In s, since 2017, when the last leap second was inserted (IERS Bulletin C 52).
_KNOWN_S = {18: "GPS and UTC (18 s)", 37: "TAI and UTC (37 s)", 19: "TAI and GPS (19 s)"}
_TOLERANCE_NS = 500_000_000


def named_offset(offset_ns: int) -> str:
    """The two time scales that lie `offset_ns` apart, in either direction and within 0.5 s; "" if no known ones do."""
    return next((text for s, text in _KNOWN_S.items() if abs(abs(offset_ns) - s * 10**9) < _TOLERANCE_NS), "")
