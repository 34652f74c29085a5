# SPDX-License-Identifier: Apache-2.0
"""fcsl_sample_t as NumPy has it: samples of channels and values of fields, each with the tick that it comes before."""

from __future__ import annotations

import numpy as np

from .run import SAMPLE_BYTES

#: `payload` is where its scalars begin in a buffer of their own; `field`, `element` and `size` are of values of fields alone.
SAMPLE = np.dtype(
    {
        "names": ["tick", "stamp_ns", "channel", "age_ticks", "payload", "field", "element", "size"],
        "formats": ["<u8", "<i8", "<u4", "<u4", "<u8", "<u4", "<u4", "<u4"],
        "itemsize": SAMPLE_BYTES,
    }
)
#: `channel` of a value of a field.
NO_CHANNEL = 2**32 - 1
