# SPDX-License-Identifier: Apache-2.0
"""Bags: reads every format, describes, cuts, compares and exports. `fcsl bag` is the command line."""

from .bag import Array, Bag, RecordedMachine, Topic, is_made_for_a_record
from .fields import field_value
from .rows import columns, has_stamps, rows_of, stacks, stamps_s

__all__ = [
    "Array",
    "Bag",
    "RecordedMachine",
    "Topic",
    "columns",
    "field_value",
    "has_stamps",
    "is_made_for_a_record",
    "rows_of",
    "stacks",
    "stamps_s",
]
