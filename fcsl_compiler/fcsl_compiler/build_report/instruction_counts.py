# SPDX-License-Identifier: Apache-2.0
"""Written by `python3 scripts/verify instruction_table --write`: instructions of one call, libm's included.

x86-64 with FMA and SSE4.1, gcc 12, glibc 2.36.
"""

from typing import NamedTuple


class Entry(NamedTuple):
    """`most`: worst case, from the machine code; for an estimate, twice the highest count measured. `usual`: upper
    limit for nine of ten calls with arguments of common magnitude."""

    most: int
    usual: int
    is_estimate: bool = False


COUNTS: dict[str, Entry] = {
    "ceil": Entry(4, 2, is_estimate=True),
    "ceilf": Entry(4, 2, is_estimate=True),
    "copysign": Entry(14, 7, is_estimate=True),
    "copysignf": Entry(14, 7, is_estimate=True),
    "cr_acos": Entry(700, 144),
    "cr_acosf": Entry(123, 69),
    "cr_asin": Entry(726, 144),
    "cr_asinf": Entry(128, 70),
    "cr_atan": Entry(688, 548),
    "cr_atan2": Entry(23084, 164),
    "cr_atan2f": Entry(1718, 105),
    "cr_atanf": Entry(68, 68),
    "cr_cbrt": Entry(395, 160),
    "cr_cbrtf": Entry(102, 65),
    "cr_cos": Entry(3045, 333),
    "cr_cosf": Entry(164, 59),
    "cr_cosh": Entry(796, 192),
    "cr_coshf": Entry(103, 65),
    "cr_exp": Entry(762, 100),
    "cr_expf": Entry(77, 43),
    "cr_expm1": Entry(766, 111),
    "cr_expm1f": Entry(93, 60),
    "cr_hypot": Entry(487, 152),
    "cr_hypotf": Entry(175, 63),
    "cr_log": Entry(3466, 135),
    "cr_log10": Entry(3552, 169),
    "cr_log10f": Entry(97, 51),
    "cr_log1p": Entry(611, 115),
    "cr_log1pf": Entry(111, 54),
    "cr_log2": Entry(429, 100),
    "cr_log2f": Entry(69, 44),
    "cr_logf": Entry(101, 47),
    "cr_pow": Entry(23903, 427),
    "cr_powf": Entry(3393, 196),
    "cr_sin": Entry(3052, 350),
    "cr_sinf": Entry(137, 61),
    "cr_sinh": Entry(819, 197),
    "cr_sinhf": Entry(103, 65),
    "cr_tan": Entry(3519, 429),
    "cr_tanf": Entry(205, 77),
    "cr_tanh": Entry(733, 203),
    "cr_tanhf": Entry(60, 60),
    "floor": Entry(4, 2, is_estimate=True),
    "floorf": Entry(4, 2, is_estimate=True),
    "fmod": Entry(26772, 106, is_estimate=True),
    "fmodf": Entry(3430, 104, is_estimate=True),
    "nearbyint": Entry(4, 2, is_estimate=True),
    "nearbyintf": Entry(4, 2, is_estimate=True),
    "rint": Entry(4, 2, is_estimate=True),
    "rintf": Entry(4, 2, is_estimate=True),
    "round": Entry(42, 21, is_estimate=True),
    "roundeven": Entry(4, 2, is_estimate=True),
    "roundevenf": Entry(4, 2, is_estimate=True),
    "roundf": Entry(42, 21, is_estimate=True),
    "trunc": Entry(4, 2, is_estimate=True),
    "truncf": Entry(4, 2, is_estimate=True),
}
