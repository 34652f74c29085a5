# SPDX-License-Identifier: Apache-2.0
"""Sends lines to rerun: many entities at once, as one table with a column for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from ..bag import Array

TIMELINE = "sim_time"
#: Rows per table: large enough to be quick, small enough that the viewer can load piece by piece.
_ROWS = 20_000
#: Columns per table. Sending holds Python's lock, and the time per column grows with their number.
_COLUMNS = 64
_SCALARS = rr.Scalars.descriptor_scalars()
_INDEX = pa.field(TIMELINE, pa.duration("ns"), metadata={"rerun:kind": "index", "rerun:index_name": TIMELINE})


def times(t_s: Any) -> Any:
    """Times in s (array or scalar) as rerun's timedelta64, rounded to ns; rerun itself would truncate a float."""
    return np.rint(np.multiply(t_s, 1e9)).astype("timedelta64[ns]")


def send_lines(stream: rr.RecordingStream, t_s: Array, lines: Mapping[str, Array]) -> None:
    """Logs `lines` at the times t_s (N,): maps an entity to float64 values of shape (N,), or (N, lines of the entity)."""
    entities = list(lines)
    for first in range(0, len(entities), _COLUMNS):
        some = {entity: lines[entity] for entity in entities[first : first + _COLUMNS]}
        schema = pa.schema([_INDEX, *(_field(entity) for entity in some)])
        for row in range(0, len(t_s), _ROWS):
            rows = slice(row, row + _ROWS)
            columns = [pa.array(times(t_s[rows])), *(_column(values[rows]) for values in some.values())]
            stream.send_record_batch(pa.RecordBatch.from_arrays(columns, schema=schema))


def _field(entity: str) -> pa.Field:
    """rerun's description of a column: its entity, and that it holds scalars."""
    described = {
        "rerun:kind": "data",
        "rerun:entity_path": entity,
        "rerun:archetype": _SCALARS.archetype,
        "rerun:component": _SCALARS.component,
        "rerun:component_type": _SCALARS.component_type,
    }
    return pa.field(entity, pa.list_(pa.float64()), metadata=described)


def _column(values: Array) -> pa.Array:
    """An Arrow column with a list for each row."""
    lines = values.shape[1] if values.ndim == 2 else 1
    return pa.ListArray.from_arrays(
        np.arange(len(values) + 1, dtype=np.int32) * np.int32(lines), np.ascontiguousarray(values).ravel()
    )
