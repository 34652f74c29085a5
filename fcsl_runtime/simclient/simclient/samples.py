# SPDX-License-Identifier: Apache-2.0
"""fcsl_sample_t as a NumPy type: channel samples and field values, each with the tick that it precedes."""

from __future__ import annotations

import numpy as np

from .run import SAMPLE_BYTES

#: `payload` is the offset of the scalars in a separate buffer; `field`, `element` and `size` apply to field values
#: only. The padding has a name, because NumPy drops unnamed padding when it concatenates.
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
#: Value of `channel` for a field value.
NO_CHANNEL = 2**32 - 1
