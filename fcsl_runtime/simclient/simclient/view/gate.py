# SPDX-License-Identifier: Apache-2.0
"""What the gate let through (docs/hardware/arming.md): the value that an actuator got, beside its command.

A simulation that is flown for its picture knows which output each actuator channel carries. A bag has what the
actuators got by channel, and not the outputs. There, a channel belongs to the output that made every value which the
channel got while the gate was open. Delays on the way do not matter. Where it got one value alone, which others may have
made too, the output must have the channel's name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fcsl_compiler.api.ros_names import recorded_path

from ..bag import Array
from .panels import Curve, Panel, label_of
from .recorded import RecordedRun, Rows
from .signals import ARMED, GATE, STATUS_FIELDS, Value, whole
from .styles import AFTER_GATE


def actuators(run: RecordedRun) -> list[Value]:
    """What the actuators got, by channel. Empty for a run that records no gate."""
    return [whole(s, name) for s in run.signals if s.is_gate for name in s.sizes if name != GATE]


def let_through(run: RecordedRun, channels: Mapping[str, str] | None = None) -> dict[str, Value]:
    """What actuators got, by the path of the command. channels: the output of each actuator channel, where it is known.

    A channel whose output is unknown is missing. Raises BagError.
    """
    got = actuators(run)
    if not got:
        return {}
    if channels is None:
        commands = _commands_of(run, got)
    else:
        paths = {name.replace(".", "_"): path for name, path in channels.items()}
        commands = [run.catalogue.find(recorded_path(paths[value.field])) for value in got]
    return {command.path: value for command, value in zip(commands, got, strict=True) if command is not None}


def beside(panel: Panel, got: Mapping[str, Value]) -> Panel:
    """The panel, and behind each command what its actuator got."""
    shown = {curve.value.path for curve in panel.curves}
    curves = list[Curve]()
    for curve in panel.curves:
        value = got.get(curve.value.path.partition("[")[0])
        if value is None or curve.angle is not None:
            curves.append(curve)
            continue
        curves.append(
            replace(curve, role="command", label=f"{curve.label} (command)") if curve.role == "values" else curve
        )
        if value.path not in shown:
            path = next(path for path, element in value.elements() if element == curve.element)
            unit = f", {value.unit}" if curve.label.endswith(f", {value.unit}") else ""
            curves.append(Curve(value, curve.element, None, AFTER_GATE, label_of(path, AFTER_GATE) + unit))
    return replace(panel, curves=tuple(curves))


def _commands_of(run: RecordedRun, got: Sequence[Value]) -> list[Value | None]:
    """The output that each actuator channel carries; None where no output, or more than one, can have made its values."""
    kinds = {_kind_of(value) for value in got}
    outputs = [
        value
        for value in run.catalogue.values.values()
        if not value.signals.truth
        and value.signals.part == "outputs"
        and value.field not in STATUS_FIELDS
        and _kind_of(value) in kinds
    ]
    gate = whole(got[0].signals, GATE)
    rows = run.read([gate, *got, *outputs])
    is_open = _values(rows, gate) == ARMED
    found = list[Value | None]()
    for value in got:
        passed = _values(rows, value)[is_open]
        makers = [o for o in outputs if _kind_of(o) == _kind_of(value) and _made(_values(rows, o), passed)]
        if len(makers) > 1 or len(np.unique(passed)) < 2:
            makers = [o for o in makers if o.field.rpartition(".")[2] == value.field]
        found.append(makers[0] if len(makers) == 1 else None)
    return found


def _kind_of(value: Value) -> tuple[tuple[int, ...], bool]:
    return value.shape, value.field in value.signals.steps


def _values(rows: Mapping[str, Rows], value: Value) -> Array:
    return rows[value.signals.topic].fields[value.field]


def _made(made: Array, passed: Array) -> bool:
    """Whether an output had each of the values that were passed on, element by element, at any time."""
    pairs = zip(made.reshape(len(made), -1).T, passed.reshape(len(passed), -1).T, strict=True)
    return all(np.isin(np.unique(theirs[~np.isnan(theirs)]), mine).all() for mine, theirs in pairs)
