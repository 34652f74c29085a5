# SPDX-License-Identifier: Apache-2.0
"""Times as text."""

_NS = 1_000_000_000


def seconds(time_ns: int) -> str:
    """`time_ns` in seconds with all nine digits, exactly."""
    sign = "-" if time_ns < 0 else ""
    return f"{sign}{abs(time_ns) // _NS}.{abs(time_ns) % _NS:09d}"
