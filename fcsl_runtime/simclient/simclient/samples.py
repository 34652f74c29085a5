# SPDX-License-Identifier: Apache-2.0
"""fcsl_sample_t as NumPy has it: samples of channels and values of fields, each with the tick that it comes before."""

from __future__ import annotations

import numpy as np

from .run import SAMPLE_BYTES

#: `payload` is where its scalars begin in a buffer of their own; `field`, `element` and `size` are of values of fields alone. The
#: bytes at the end have a name because NumPy drops those that have none when it concatenates.
SAMPLE = np.dtype(
    [
        ("tick", "<u8"),
        ("stamp_ns", "<i8"),
        ("channel", "<u4"),
        ("age_ticks", "<u4"),
        ("payload", "<u8"),
        ("field", "<u4"),
        ("element", "<u4"),
        ("size", "<u4"),
        ("unused", "<u4"),
    ]
)
assert SAMPLE.itemsize == SAMPLE_BYTES
#: `channel` of a value of a field.
NO_CHANNEL = 2**32 - 1
