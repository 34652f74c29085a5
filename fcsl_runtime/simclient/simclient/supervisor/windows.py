# SPDX-License-Identifier: Apache-2.0
"""The last ticks of chosen paths of a run, from its telemetry, as JSON or as an Arrow IPC stream."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..descriptor import Machine
from ..errors import TwinError
from ..paths import Selection, resolve
from ..telemetry.configuration import Configuration
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from .http_error import HttpError
from .limits import WINDOW_TICKS, WINDOW_VALUES

_NO_TELEMETRY = "none was received yet, or the run has ended and windows of later runs replaced its window"
_WHAT_IS_SENT = "GET /runs/ID lists the channels that its telemetry sends"
#: A negative index, or a slice.
_SLICE = re.compile(r"\[[^\]]*[:-]")
_NO_SLICES = (
    "a window takes single indices from 0 on; slices and negative indices work with /values while the run is running"
)
ARROW = "application/vnd.apache.arrow.stream"


@dataclass(frozen=True)
class Cut:
    """The last received rows, and the fields that the requested paths select. Lost ticks have no row."""

    rows: Window
    #: By requested path, then by the rest of the leaf's path: empty if the requested path is a leaf.
    selected: Mapping[str, Mapping[str, Selection]]

    @property
    def leaves(self) -> dict[str, Selection]:
        """By the leaves' full paths."""
        return {leaf.path: leaf for leaves in self.selected.values() for leaf in leaves.values()}

    def as_json(self) -> dict[str, Any]:
        """`tick`, `time_ns`: lists; `values`: maps a path to a list with a value for each tick; `units`."""
        return {
            "session": str(self.rows.session),
            "tick": self.rows.tick.tolist(),
            "time_ns": self.rows.time_ns.tolist(),
            "values": {path: self.rows[path].tolist() for path in self.leaves},
            "units": {path: leaf.field.unit for path, leaf in self.leaves.items()},
        }

    def as_arrow(self) -> bytes:
        """The same as an IPC stream: columns `tick`, `time_ns` and the paths.

        Arrays are fixed-size lists, names a dictionary.
        """
        import pyarrow as pa

        columns = {"tick": pa.array(self.rows.tick), "time_ns": pa.array(self.rows.time_ns)}
        columns |= {path: _column(self.rows[path]) for path in self.leaves}
        units = {"tick": "", "time_ns": "ns"} | {path: leaf.field.unit for path, leaf in self.leaves.items()}
        machine = self.rows.machine
        about = {"machine": machine.name, "source_hash": machine.source_hash, "session": str(self.rows.session)}
        fields = [pa.field(name, column.type, metadata={"unit": units[name]}) for name, column in columns.items()]
        table = pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields, metadata=about))
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, table.schema) as stream:
            stream.write_table(table)
        return bytes(sink.getvalue())


def cut(telemetry: Telemetry, paths: Sequence[str], ticks: int) -> Cut:
    """The last `ticks` rows of these paths. Raises HttpError."""
    if not 1 <= ticks <= WINDOW_TICKS:
        raise HttpError(400, "bad_value", f"ticks: expected 1 to {WINDOW_TICKS}, not {ticks}")
    machine = _configuration(telemetry).machine
    try:
        selected = {path: fields_below(path, machine) for path in paths}
        leaves = [leaf for found in selected.values() for leaf in found.values()]
        _bound(leaves, ticks)
        return Cut(telemetry.window([leaf.field.path for leaf in leaves], ticks), selected)
    except TwinError as error:
        raise unknown_path(error, paths) from None


def channels(telemetry: Telemetry) -> dict[str, Any]:
    """What is sent: the rate, and type, shape, unit and names of the values 0, 1, ... by path. Raises HttpError."""
    sent = _configuration(telemetry)
    described = {
        path: {"type": channel.type, "shape": channel.shape, "unit": channel.unit, "labels": channel.labels}
        for path, channel in sent.channels.items()
    }
    return {"machine": sent.machine.name, "tick_hz": sent.machine.tick_hz, "every": sent.every, "channels": described}


def _configuration(telemetry: Telemetry) -> Configuration:
    try:
        return telemetry.configuration
    except TwinError as error:
        raise HttpError(
            409, "no_telemetry", f"no telemetry of this run: {error}".partition(";")[0], _NO_TELEMETRY
        ) from None


def unknown_path(error: TwinError, paths: Sequence[str]) -> HttpError:
    """Of these paths telemetry does not send one."""
    hint = _NO_SLICES if any(map(_SLICE.search, paths)) else _WHAT_IS_SENT
    return HttpError(404, "unknown_path", str(error), hint)


def fields_below(path: str, machine: Machine) -> dict[str, Selection]:
    """The sent fields that the variable server's `get` finds at a path, including groups such as an instance."""
    inside = [field for field in machine.fields if field.startswith((f"{path}.", f"{path}["))]
    parts = [resolve(found, machine) for found in inside or [path]]
    name = path if inside else parts[0].path
    return {leaf.path.removeprefix(name).removeprefix("."): leaf for part in parts for leaf in part.leaves()}


def _bound(leaves: Sequence[Selection], ticks: int) -> None:
    scalars = sum(math.prod(leaf.shape) for leaf in leaves)
    if scalars * ticks > WINDOW_VALUES:
        most = WINDOW_VALUES // scalars
        raise HttpError(
            413, "too_large", f"{ticks} ticks of {scalars} scalars are more than {WINDOW_VALUES}", f"ticks={most}"
        )


def _column(values: Any) -> Any:
    """An Arrow array of a column of shape (rows, *shape of the field)."""
    import pyarrow as pa

    flat = pa.array(values.reshape(-1))
    if pa.types.is_string(flat.type):
        flat = flat.dictionary_encode()
    for extent in reversed(values.shape[1:]):
        flat = pa.FixedSizeListArray.from_arrays(flat, extent)
    return flat
