# SPDX-License-Identifier: Apache-2.0
"""Reads rerun files back, with rerun's own reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rerun.blueprint as rrb
from rerun.chunk import RrdReader

_VIEW = ("ViewBlueprint:display_name", "ViewBlueprint:class_identifier")
#: entity -> [(time in s, component -> value)] in order of time
Rows = dict[str, list[tuple[float, dict[str, Any]]]]


def read_rrd(path: Path) -> Rows:
    """What an .rrd holds on the timeline sim_time; static data is left out."""
    found: Rows = {}
    for chunk in RrdReader(str(path)).stream():
        if chunk.is_static or "sim_time" not in chunk.timeline_names:
            continue
        batch = chunk.to_record_batch()
        columns = batch.select([name for name in batch.schema.names if ":" in name]).to_pydict()
        for row, time_ns in enumerate(batch.column("sim_time").cast("int64").to_pylist()):
            said = {name: column[row] for name, column in columns.items() if column[row] is not None}
            found.setdefault(chunk.entity_path, []).append((time_ns / 1e9, said))
    return {entity: sorted(rows, key=lambda row: row[0]) for entity, rows in found.items()}


def values(rows: Rows, entity: str, component: str) -> list[tuple[float, Any]]:
    """(time, value) of one component; a value that stands alone is no list."""
    shown = [(time, v[component]) for time, v in rows.get(entity, []) if component in v]
    return [(time, value[0] if len(value) == 1 else value) for time, value in shown]


def views(path: Path) -> dict[str, str]:
    """Name to kind of the views of a file's blueprint."""
    reader = RrdReader(str(path))
    found = {}
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        if {*_VIEW} <= {*batch.schema.names}:
            (name,), (kind,) = (batch.column(column)[0].as_py() for column in _VIEW)
            found[name] = kind
    return found


def time_series(node: Any) -> list[rrb.TimeSeriesView]:
    """The plots below a container of a blueprint, in order."""
    if isinstance(node, rrb.Container):
        return [plot for child in node.contents for plot in time_series(child)]
    return [node] if isinstance(node, rrb.TimeSeriesView) else []
