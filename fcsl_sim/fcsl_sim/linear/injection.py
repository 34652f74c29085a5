# SPDX-License-Identifier: Apache-2.0
"""A simulation in which sines are added to inputs: a file that extends another one, with a model between source and target."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile, nearest
from fcsl_compiler.api.json_files import JsonNode
from simclient.descriptor import Machine

from ..config import MAX_SECONDS, SimConfig
from ..errors import SimError
from ..extends import read_extended
from ..models import type_of

#: By the type of the input.
_MODELS = {"f64": "sine_injection", "f64[3]": "sine_injection_vector"}
_INPUT = re.compile(r"(\w+)\.(?:inputs\.)?([\w.]+)(?:\[(\d+)\])?(?:=(.+))?")


@dataclass(frozen=True)
class Injection:
    """`instance` adds `weight` times the sine to the input at `path`: to its element `element`, or () for a number.
    `is_commanded`: the source is a controller."""

    path: str
    weight: float
    instance: str
    element: tuple[int, ...]
    is_commanded: bool

    def amplitude(self, amplitude: float) -> float | list[float]:
        """Of the model's parameter."""
        value = self.weight * amplitude
        return [value if i == self.element[0] else 0.0 for i in range(3)] if self.element else value


def with_injections(config: SimConfig, inputs: Sequence[str], file: Path) -> list[Injection]:
    """Writes `file`, which extends the simulation. inputs: `instance.inputs.name`, `instance.inputs.name[1]`, `controller.channel`,
    each with `=WEIGHT` or not. A sensor channel gets the sum of its source and the sine; so does all that an actuator channel
    feeds. The duration is left out; the stop condition stays. Raises SimError."""
    tree = _plain(_merged(config.path))
    assert isinstance(tree, dict)
    connections: list[dict[str, str]] = list(tree.get("connections", []))
    targets = [text.partition("=")[0].replace(".inputs.", ".").partition("[")[0] for text in inputs]
    if len(set(targets)) < len(targets):
        twice = next(target for target in targets if targets.count(target) > 1)
        raise SimError(f"`{twice}` is named twice; of a vector one element can be chosen")
    over: dict[str, Any] = {
        "extends": str(config.path.resolve()),
        "duration": MAX_SECONDS / 1000,
        "models": {},
        "instances": {},
        "rates": {},
    }
    found: list[Injection] = []
    for text in inputs:
        found.append(_inject(config, text, f"response_injection_{len(found) + 1}", tree, connections, over))
    file.write_text(json.dumps({**over, "connections": connections}))
    return found


def with_moved(sets: Sequence[str], injections: Sequence[Injection]) -> list[str]:
    """`--set` of the simulation as those of the file with injections, where a sine's input has the value in their place."""
    moved = {i.path.partition("[")[0]: f"{i.instance}.inputs.value" for i in injections}
    paths = [re.match(r"[^\[=]*", text)[0] for text in sets]  # type: ignore[index]  # it matches the empty text, too
    return [moved.get(path, path) + text[len(path) :] for path, text in zip(paths, sets, strict=True)]


def _inject(
    config: SimConfig,
    text: str,
    name: str,
    tree: dict[str, Any],
    connections: list[dict[str, str]],
    over: dict[str, Any],
) -> Injection:
    parts = _INPUT.fullmatch(text)
    if not parts:
        raise SimError(f"`{text}`: `instance.inputs.name`, or `controller.channel`, wanted")
    head, field, index, weight = parts.groups()
    target = f"{head}.{field}"
    type_, value, is_source = _target(config, tree, head, field)
    if type_ not in _MODELS:
        raise SimError(f"`{target}` is {type_}: a sine is added to {' or an element of '.join(_MODELS)} alone")
    is_vector = type_ == "f64[3]"
    if is_vector != bool(index) or (index and int(index) > 2):
        wanted = f"one element of it, `{text.partition('[')[0]}[0]`" if is_vector else "it without an index"
        raise SimError(f"`{target}` is {type_}: name {wanted}")
    source = _connect(name, target, is_source, connections, list(over["instances"]))
    model = _MODELS[type_]
    over["models"][model] = {"source": f"package://fcsl_sim/models/{model}.c"}
    zero = [0.0, 0.0, 0.0] if is_vector else 0.0
    controllers = {config.controller, "controller", *config.companions}
    is_commanded = (source or "").partition(".")[0] in controllers
    held = is_commanded or head in controllers
    parameters = {"amplitude": zero, "frequency": 0.0, "start": 0.0, "held": held}
    over["instances"][name] = {"model": model, "parameters": parameters}
    if value is not None:
        over["instances"][name]["inputs"] = {"value": value}
        over["instances"][head] = {"inputs": {field: None}}
    rates = tree.get("rates", {})
    over["rates"][name] = rates.get((source or "").partition(".")[0], config.machine.tick_hz)
    element = f"[{index}]" if index else ""
    path = f"{head}.{field}" if head in controllers else f"{head}.inputs.{field}"
    return Injection(f"{path}{element}", _weight(text, weight), name, (int(index),) if index else (), is_commanded)


def _connect(
    name: str, target: str, is_source: bool, connections: list[dict[str, str]], injections: Sequence[str]
) -> str | None:
    """Puts injection `name` before `target`, or behind it where it is a source. Returns the source of the injection, if it has
    one. Raises SimError."""
    if is_source:
        behind = [c for c in connections if c["from"] == target]
        taken = next((c["to"] for c in behind if c["to"].partition(".")[0] in injections), None)
        if taken is not None or not behind:
            why = "feeds an input that has a sine already" if behind else "feeds nothing"
            raise SimError(f"`{target}` {why}")
        connections[:] = [{**c, "from": f"{name}.value"} if c in behind else c for c in connections]
        connections.append({"from": target, "to": f"{name}.value"})
        return target
    source = next((c["from"] for c in connections if c["to"] == target), None)
    if source and source.partition(".")[0] in injections:
        raise SimError(f"`{target}` has a sine already, by its source")
    connections[:] = [
        *({**c, "to": f"{name}.value"} if c["to"] == target else c for c in connections),
        {"from": f"{name}.value", "to": target},
    ]
    return source


def _weight(text: str, weight: str | None) -> float:
    try:
        value = float(weight or "1")
    except ValueError:
        raise SimError(f"`{text}`: {weight} is no number") from None
    if not 1e-9 <= abs(value) <= 1e9:
        raise SimError(f"`{text}`: a weight is neither zero nor huge")
    return value


def _target(config: SimConfig, tree: dict[str, Any], head: str, field: str) -> tuple[str, Any, bool]:
    """The type of an input or channel; the value that the file gives to an input, or None; whether it is a source: an actuator
    channel. Raises SimError."""
    table = config.tables.get(head)
    if table:
        inputs = {f.name: f for f in table.of_role("input")}
        if field in inputs:
            return str(inputs[field].type), tree["instances"][head].get("inputs", {}).get(field), False
        raise SimError(
            f"`{head}` has no input `{field}`; {nearest(field, list(inputs)) or 'it has ' + ', '.join(inputs)}"
        )
    machines = {config.controller: config.machine, **{n: c.machine for n, c in config.companions.items()}}
    machine = machines.get(head)
    if machine is None:
        known = [*config.tables, *machines]
        raise SimError(
            f"there is no instance or controller `{head}`; {nearest(head, known) or 'there are ' + ', '.join(known)}"
        )
    ends = {**machine.fields, **{c.name: c.field for c in machine.channels}}
    if field not in ends:
        hint = nearest(field, [c.name for c in machine.channels]) or _channels(machine)
        raise SimError(f"`{machine.name}` has no channel `{field}`; {hint}")
    directions = {c.name: c.direction for c in machine.channels}
    is_source = directions[field] == "actuator" if field in directions else ends[field].role == "output"
    return str(type_of(ends[field].type, ends[field].shape)), None, is_source


def _channels(machine: Machine) -> str:
    """It has the sensor channel x, and the actuator channels u, v."""
    texts = []
    for direction in ("sensor", "actuator"):
        names = [c.name for c in machine.channels if c.direction == direction]
        texts += [f"the {direction} channel{'s' if len(names) > 1 else ''} {', '.join(names)}"] if names else []
    return f"it has {', and '.join(texts)}" if texts else "it has none"


def _merged(path: Path) -> JsonNode:
    """The members of a file that was checked before."""
    root = read_extended(SourceFile.read(path, str(path)), DiagnosticSink())
    assert root is not None
    return root


def _plain(node: JsonNode) -> Any:
    if node.kind == "object":
        return {key: _plain(member.value) for key, member in node.members.items()}
    if node.kind == "array":
        return [_plain(item) for item in node.items]
    return node.value
