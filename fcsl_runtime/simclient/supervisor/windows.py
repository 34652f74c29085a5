# SPDX-License-Identifier: Apache-2.0
"""The last ticks of some paths of a run, as its telemetry brought them: as JSON, or as an Arrow IPC stream."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import TwinError
from ..paths import Selection, resolve
from ..telemetry.receiver import Telemetry
from ..telemetry.window import Window
from .limits import WINDOW_TICKS, WINDOW_VALUES
from .refusal import Refusal

_NO_TELEMETRY = "none has come yet, or it has ended and the windows of later runs took its place"
ARROW = "application/vnd.apache.arrow.stream"


@dataclass(frozen=True)
class Cut:
    """The last rows that came, and the leaves of the paths that were asked for, in their order. Ticks that were lost have no row."""

    rows: Window
    leaves: Mapping[str, Selection]

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
    """The last `ticks` rows of these paths. Raises Refusal."""
    if not 1 <= ticks <= WINDOW_TICKS:
        raise Refusal(400, "bad_value", f"ticks: expected 1 to {WINDOW_TICKS}, not {ticks}")
    try:
        machine = telemetry.machine
    except TwinError as error:
        raise Refusal(
            409, "no_telemetry", f"no telemetry of this run: {error}".partition(";")[0], _NO_TELEMETRY
        ) from None
    try:
        leaves = {leaf.path: leaf for path in paths for leaf in resolve(path, machine).leaves()}
        _bound(list(leaves.values()), ticks)
        return Cut(telemetry.window([leaf.field.path for leaf in leaves.values()], ticks), leaves)
    except TwinError as error:
        raise Refusal(
            404, "unknown_path", str(error), "GET /runs/ID lists the channels that its telemetry sends"
        ) from None


def _bound(leaves: Sequence[Selection], ticks: int) -> None:
    scalars = sum(math.prod(leaf.shape) for leaf in leaves)
    if scalars * ticks > WINDOW_VALUES:
        most = WINDOW_VALUES // scalars
        raise Refusal(
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
