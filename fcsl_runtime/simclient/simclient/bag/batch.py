# SPDX-License-Identifier: Apache-2.0
"""Messages in batches: their bytes in one buffer, and an entry for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

#: A message: the number of its channel in its file, the time of recording, and the range of its bytes. In memory it is
#: fcsl_mcap_record_t, so that nothing is copied where all records of a chunk are messages.
ENTRY = np.dtype(
    {
        "names": ["number", "log_ns", "begin", "end"],
        "formats": ["<u4", "<i8", "<i8", "<i8"],
        "offsets": [24, 16, 0, 8],
        "itemsize": 32,
    }
)
#: (number of the channel, time of recording in ns, bytes).
Message = tuple[int, int, bytes]


class Batch(NamedTuple):
    """Messages of one file; each ENTRY gives a message's bytes as data[begin:end]."""

    data: bytes
    entries: np.ndarray[Any, Any]


def batch_of(messages: Sequence[Message]) -> Batch:
    """The messages concatenated into one batch."""
    entries, at = [], 0
    for number, log_ns, data in messages:
        entries.append((number, log_ns, at, at + len(data)))
        at += len(data)
    return Batch(b"".join(data for _, _, data in messages), np.array(entries, ENTRY))
