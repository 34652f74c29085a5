# SPDX-License-Identifier: Apache-2.0
"""The device of a sensor in a board's JSON: what is measured, and where its corrections are written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.api.board_files import Backend, check_board
from fcsl_compiler.api.diagnostics import DiagnosticError, DiagnosticSink, SourceFile
from fcsl_compiler.api.files import SourceError, read_regular, write_whole
from fcsl_compiler.api.json_files import JsonNode, parse_json

from ..errors import TwinError, did_you_mean
from .board_edit import Changes, changed_text

_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Target:
    """A backend of a sensor of the board at `path`."""

    path: Path
    sensor: str
    backend: Backend

    def signal(self, quantity: str) -> str:
        """What the device's driver calls the quantity."""
        return self.backend.signals.get(quantity, quantity)

    def write(self, changes: Changes) -> None:
        """Into the file as it is now. Raises TwinError, and OSError."""
        path = self.path.resolve()  # of a link the file, not the link, is replaced
        source = _read(path, str(self.path))
        text = changed_text(source, self._place(source), changes)
        data = read_regular(path, len(source.text.encode()) * 2 + len(_BOM))
        if b"\r\n" in data:
            text = text.replace("\n", "\r\n")
        write_whole(path, ("\ufeff" if data.startswith(_BOM) else "") + text)

    def _place(self, source: SourceFile) -> JsonNode:
        """The backend's object. Raises TwinError where it has gone since the check."""
        node = parse_json(source, DiagnosticSink())
        for key in ("sensors", self.sensor, "backends"):
            node = node.get(key) if node is not None else None
        for item in node.items if node is not None and node.kind == "array" else ():
            device = item.get("device")
            if device is not None and device.value == self.backend.device.name:
                return item
        raise TwinError(f"{self.path}: it was changed meanwhile: sensor `{self.sensor}` has lost its device")


def find_target(path: str, sensor: str, kind: str, device: str | None) -> Target:
    """A device of a sensor of this kind. Raises TwinError."""
    try:
        board = check_board(Path(path))
    except DiagnosticError as error:
        raise TwinError(f"the board has errors\n{error}") from None
    sensors = {s.name: s for s in board.sensors}
    if sensor not in sensors:
        has = ", ".join(sensors) or "none"
        raise TwinError(f"{path}: no sensor `{sensor}`{did_you_mean(sensor, sensors)}; it has {has}")
    if sensors[sensor].kind != kind:
        raise TwinError(f"{path}: sensor `{sensor}` is of kind `{sensors[sensor].kind}`, not `{kind}`")
    backends = {b.device.name: b for b in sensors[sensor].backends}
    if device is None and len(backends) > 1:
        raise TwinError(f"{path}: sensor `{sensor}` has the devices {', '.join(backends)}: choose one with --device")
    chosen = device if device is not None else next(iter(backends))
    if chosen not in backends:
        raise TwinError(f"{path}: sensor `{sensor}` has no device `{chosen}`; it has {', '.join(backends)}")
    return Target(Path(path), sensor, backends[chosen])


def _read(path: Path, name: str) -> SourceFile:
    try:
        return SourceFile.read(path, name)
    except SourceError as error:
        raise TwinError(f"{name}: {error}") from None
