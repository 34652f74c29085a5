# SPDX-License-Identifier: Apache-2.0
"""Reads a board file and checks it against its machine. docs/board.md describes the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, Severity
from ..base.source import SourceError, SourceFile
from ..model.machine import Machine
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode, parse_json
from .backends import BackendReader
from .channels import ChannelBinder
from .devices import Device, read_devices
from .machine import load_machine
from .sensors import Sensor, read_sensors

SCHEMA = Path(__file__).parent / "board.schema.json"


@dataclass(frozen=True)
class Board:
    """A checked board, and the warnings of its check."""

    path: Path
    machine: Machine
    devices: tuple[Device, ...]
    sensors: tuple[Sensor, ...]
    warnings: tuple[Diagnostic, ...]


def check_board(path: Path) -> Board:
    """Reads and checks a board. Raises DiagnosticError with all errors, those of the machine first."""
    sink = DiagnosticSink()
    root = _parse(path, sink)
    sink.raise_if_failed()
    assert root is not None
    _refuse_machine(path, root, sink)
    reader = ConfigReader(sink)
    keys = reader.object(root, "a board", ("machine", "devices", "sensors"), ("$schema", "description")) or {}
    for key in ("$schema", "description"):
        reader.string(keys.get(key), f"`{key}`")
    machine, of_machine = load_machine(keys.get("machine"), path, reader)
    devices = read_devices(keys.get("devices"), reader)
    channels = ChannelBinder(machine, reader)
    backends = BackendReader(devices, reader, set())
    sensors = read_sensors(keys.get("sensors"), channels, backends, reader)
    _warn_unused(devices, backends.used, reader)
    channels.warn_unbound(keys.get("machine"))
    if of_machine or sink.failed:
        raise DiagnosticError([*of_machine, *(d for d in sink.diagnostics if d.severity is Severity.ERROR)])
    assert machine is not None
    return Board(path, machine, tuple(d for d in devices.values() if d), sensors, tuple(sink.diagnostics))


def _parse(path: Path, sink: DiagnosticSink) -> JsonNode | None:
    try:
        return parse_json(SourceFile.read(path, str(path)), sink)
    except SourceError as error:
        at = error.span or SourceFile(str(path), "", str(path)).whole()
        sink.error("E100", f"cannot read the board `{path}`: {error}", at)
        return None


def _refuse_machine(path: Path, root: JsonNode, sink: DiagnosticSink) -> None:
    """Raises DiagnosticError if a file is a machine JSON, by its content."""
    if root.kind == "object" and {"tick_hz", "states"} <= root.members.keys():
        fix = f'write a board whose `machine` is "{path.name}"; `fcslc check {path}` checks the machine alone'
        sink.error("E501", "this is a machine, not a board", root.span, help=fix)
        sink.raise_if_failed()


def _warn_unused(devices: dict[str, Device | None], used: set[str], reader: ConfigReader) -> None:
    for device in devices.values():
        if device is not None and device.name not in used:
            message = f"no sensor uses device `{device.name}`"
            reader.sink.warning(
                "W501", message, device.span, why="it is not opened", help="remove it, or add a backend"
            )
