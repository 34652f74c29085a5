# SPDX-License-Identifier: Apache-2.0
"""Reads a board file and checks it against its machine. docs/hardware/hal.md describes the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, Severity
from ..base.files import SourceError
from ..base.source import SourceFile
from ..model.machine import Machine
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode, parse_json
from .backends import BackendReader
from .channels import ChannelBinder
from .devices import Device, read_devices
from .drivers import known_drivers
from .hardware import Hardware, HardwareReader, warn_unreached
from .machine import load_machine
from .outputs import Output, OutputReader
from .pace import Pace, read_pace
from .sensors import Sensor, read_sensors

_SCHEMA = Path(__file__).parent / "board.schema.json"


@dataclass(frozen=True)
class Board:
    """A checked board, and the warnings of its check. `undriven`: actuator channels without an output, on purpose."""

    path: Path
    machine: Machine
    devices: tuple[Device, ...]
    sensors: tuple[Sensor, ...]
    outputs: tuple[Output, ...]
    undriven: tuple[str, ...]
    hardware: Hardware
    pace: Pace | None
    warnings: tuple[Diagnostic, ...]


def board_schema() -> str:
    """The JSON Schema of boards, with the drivers that come with FCSL. Raises PackageNotFound where there are none."""
    drivers = ", ".join(f'"{name}"' for name in known_drivers())
    return _SCHEMA.read_text(encoding="utf-8").replace('"DRIVERS"', drivers)


def check_board(path: Path) -> Board:
    """Reads and checks a board. Raises DiagnosticError with all errors, those of the machine first; PackageNotFound where the
    drivers that come with FCSL are not installed."""
    sink = DiagnosticSink()
    root = _parse(path, sink)
    sink.raise_if_failed()
    assert root is not None
    _refuse_machine(path, root, sink)
    reader = ConfigReader(sink)
    optional = ("$schema", "description", "pace", "sensors", "outputs", "hardware")
    keys = reader.object(root, "a board", ("machine", "devices"), optional) or {}
    for key in ("$schema", "description"):
        reader.string(keys.get(key), f"`{key}`")
    machine, of_machine = load_machine(keys.get("machine"), path, reader)
    devices = read_devices(keys.get("devices"), reader)
    channels = ChannelBinder(machine, reader)
    backends = BackendReader(devices, reader, set())
    sensors = read_sensors(keys.get("sensors"), channels, backends, reader)
    actuators = OutputReader(machine, devices, reader, backends.used)
    outputs = actuators.read(keys.get("outputs"))
    builtins = HardwareReader(devices, reader, backends.used, actuators)
    hardware = builtins.read(keys.get("hardware"))
    pace = read_pace(keys.get("pace"), devices, backends.used, machine.tick_hz if machine else None, reader)
    _check_purpose(root, keys, reader)
    _warn_unused(devices, backends.used | actuators.used | builtins.used, reader)
    # Without the key `sensors` or `outputs` that half of the machine is not this board's.
    if "machine" in keys and "sensors" in keys:
        channels.warn_unbound(keys["machine"])
    if "machine" in keys and "outputs" in keys:
        actuators.warn_undriven(keys["machine"])
    if "machine" in keys and ("sensors" in keys or "hardware" in keys):
        warn_unreached(hardware, machine, keys["machine"], reader)
    if of_machine or sink.failed:
        raise DiagnosticError([*of_machine, *(d for d in sink.diagnostics if d.severity is Severity.ERROR)])
    assert machine is not None
    used = tuple(d for d in devices.values() if d)
    undriven = tuple(actuators.undriven)
    return Board(path, machine, used, sensors, outputs, undriven, hardware, pace, tuple(sink.diagnostics))


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
        fix = f'write a board whose `machine` is "{path.name}"; `fcsl check {path}` checks the machine alone'
        sink.error("E501", "this is a machine, not a board", root.span, help=fix)
        sink.raise_if_failed()


def _check_purpose(root: JsonNode, keys: dict[str, JsonNode], reader: ConfigReader) -> None:
    """Reports a board without sensors, outputs and hardware."""
    parts = [keys[key] for key in ("sensors", "outputs", "hardware") if key in keys]
    if "hardware" in keys and keys["hardware"].kind == "object":
        parts = [*parts[:-1], *(member.value for member in keys["hardware"].members.values())]
    if root.kind == "object" and not any(part.kind != "object" or part.members for part in parts):
        reader.sink.error(
            "E202", "a board has no `sensors`, `outputs` or `hardware`", root.span, help="add one of them"
        )


def _warn_unused(devices: dict[str, Device | None], used: set[str], reader: ConfigReader) -> None:
    for device in devices.values():
        if device is not None and device.name not in used:
            message, fix = f"nothing uses device `{device.name}`", "remove it, or add a backend, an output or a pin"
            reader.sink.warning("W501", message, device.span, why="it is not opened", help=fix)
