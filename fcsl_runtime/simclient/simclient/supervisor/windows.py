# SPDX-License-Identifier: Apache-2.0
"""The last ticks of some paths of a run, as its telemetry brought them: as JSON, or as an Arrow IPC stream."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..descriptor import Machine
from ..errors import TwinError
from ..paths import Selection, resolve
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from .http_error import HttpError
from .limits import WINDOW_TICKS, WINDOW_VALUES

_NO_TELEMETRY = "none has come yet, or it has ended and the windows of later runs took its place"
_WHAT_IS_SENT = "GET /runs/ID lists the channels that its telemetry sends"
#: An index that counts from the end, or several at once.
_SLICE = re.compile(r"\[[^\]]*[:-]")
_NO_SLICES = "slices and indices from the end are taken by /values while the run runs; here write each index, from 0 on"
ARROW = "application/vnd.apache.arrow.stream"


@dataclass(frozen=True)
class Cut:
    """The last rows that came, and what the paths that were asked for select. Ticks that were lost have no row."""

    rows: Window
    #: By path, and in each by the rest of the leaf's own path: empty where the path itself is a leaf.
    selected: Mapping[str, Mapping[str, Selection]]

    @property
    def leaves(self) -> dict[str, Selection]:
        """By their own paths."""
        return {leaf.path: leaf for leaves in self.selected.values() for leaf in leaves.values()}

    def as_json(self) -> dict[str, Any]:
        """`tick`, `time_ns`: lists; `values`: from path to a list with a value for each tick; `units`."""
        return {
            "session": str(self.rows.session),
            "tick": self.rows.tick.tolist(),
            "time_ns": self.rows.time_ns.tolist(),
            "values": {path: self.rows[path].tolist() for path in self.leaves},
            "units": {path: leaf.field.unit for path, leaf in self.leaves.items()},
        }

    def as_arrow(self) -> bytes:
        """The same as an IPC stream: columns `tick`, `time_ns` and the paths. Arrays are lists of fixed size, names a dictionary."""
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
    try:
        machine = telemetry.machine
    except TwinError as error:
        raise HttpError(
            409, "no_telemetry", f"no telemetry of this run: {error}".partition(";")[0], _NO_TELEMETRY
        ) from None
    try:
        selected = {path: _below(path, machine) for path in paths}
        leaves = [leaf for found in selected.values() for leaf in found.values()]
        _bound(leaves, ticks)
        return Cut(telemetry.window([leaf.field.path for leaf in leaves], ticks), selected)
    except TwinError as error:
        hint = _NO_SLICES if any(map(_SLICE.search, paths)) else _WHAT_IS_SENT
        raise HttpError(404, "unknown_path", str(error), hint) from None


def _below(path: str, machine: Machine) -> dict[str, Selection]:
    """What `get` of the variable server finds at a path, as far as it is sent: also below an instance or another group."""
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
    """An Arrow array of a column: of shape (rows, *shape of the field)."""
    import pyarrow as pa

    flat = pa.array(values.reshape(-1))
    if pa.types.is_string(flat.type):
        flat = flat.dictionary_encode()
    for extent in reversed(values.shape[1:]):
        flat = pa.FixedSizeListArray.from_arrays(flat, extent)
    return flat
