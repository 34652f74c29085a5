# SPDX-License-Identifier: Apache-2.0
"""Written by scripts/verify/instruction_table.py --write: the most instructions of one call, libm's included.

x86-64 with FMA and SSE4.1, gcc 12, glibc 2.36. From the machine code, but for lines marked `counted`: twice the most
that was counted.
"""

COUNTS: dict[str, int] = {
    "ceil": 4,  # counted
    "ceilf": 4,  # counted
    "copysign": 14,  # counted
    "copysignf": 14,  # counted
    "cr_acos": 692,
    "cr_acosf": 123,
    "cr_asin": 1252,  # counted
    "cr_asinf": 128,
    "cr_atan": 688,
    "cr_atan2": 23084,
    "cr_atan2f": 1718,
    "cr_atanf": 68,
    "cr_cbrt": 395,
    "cr_cbrtf": 102,
    "cr_cos": 3045,
    "cr_cosf": 164,
    "cr_cosh": 1342,  # counted
    "cr_coshf": 99,
    "cr_exp": 1270,  # counted
    "cr_expf": 77,
    "cr_expm1": 1166,  # counted
    "cr_expm1f": 89,
    "cr_hypot": 570,  # counted
    "cr_hypotf": 175,
    "cr_log": 4884,  # counted
    "cr_log10": 368,  # counted
    "cr_log10f": 97,
    "cr_log1p": 607,
    "cr_log1pf": 111,
    "cr_log2": 429,
    "cr_log2f": 69,
    "cr_logf": 101,
    "cr_pow": 17276,  # counted
    "cr_powf": 3166,  # counted
    "cr_sin": 3052,
    "cr_sinf": 137,
    "cr_sinh": 1452,  # counted
    "cr_sinhf": 99,
    "cr_tan": 3519,
    "cr_tanf": 205,
    "cr_tanh": 1218,  # counted
    "cr_tanhf": 60,
    "floor": 4,  # counted
    "floorf": 4,  # counted
    "fmod": 26772,  # counted
    "fmodf": 3430,  # counted
    "nearbyint": 4,  # counted
    "nearbyintf": 4,  # counted
    "rint": 4,  # counted
    "rintf": 4,  # counted
    "round": 42,  # counted
    "roundeven": 4,  # counted
    "roundevenf": 4,  # counted
    "roundf": 42,  # counted
    "trunc": 4,  # counted
    "truncf": 4,  # counted
}
