# SPDX-License-Identifier: Apache-2.0
"""Reads a `*.sim.json` and checks it.

Its vocabulary and diagnostics are those of a machine JSON, with models in place of algorithms; additional codes:
codes.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from fcsl_compiler.api.build import DEFAULT_BACKEND, ToolchainError, build_machine, toolchain
from fcsl_compiler.api.diagnostics import (
    Diagnostic,
    DiagnosticError,
    DiagnosticSink,
    Severity,
    SourceFile,
    Span,
    nearest,
)
from fcsl_compiler.api.files import SourceError
from fcsl_compiler.api.json_files import (
    ConfigReader,
    Everything,
    JsonNode,
    SourcePathError,
    read_constants,
    resolve_source,
)
from fcsl_compiler.api.sections import Signals, read_views
from fcsl_compiler.api.types import Type, count_of, scalar_of
from simclient.descriptor import Machine
from simclient.errors import TwinError
from simclient.parameters import Given, read_parameters
from simclient.run import open_run

from . import plan
from .controller_parameters import StartValues, controller_parameters
from .errors import SimError
from .event_argument import with_events
from .extends import file_of, read_extended
from .integrators import Integrator, read_integrator
from .machine_model import machine_model
from .models import ModelField, ModelTable, type_of, with_unit
from .plan import Plan, Target
from .plant_only import MAX_TICK_HZ, build_plant_only
from .plugins import model_library, model_source, source_text
from .ros import TruthTopic
from .set_argument import Settings, Value, with_elements
from .table_parameter import read_table
from .time_comparison import time_comparison
from .whole_ticks import whole_ticks
from .wiring import MAX_SECONDS, Instance, Wiring, check_wiring, seconds

MAX_TICKS = 10**12
#: Of a controller's commands (src/plan/plan.h).
MAX_DELAY_TICKS = 1000
#: Keys that say nothing about the flight; `extends` was followed before.
FOR_READERS = ("$schema", "description", "extends")
#: The model that may stand between plant and controller.
SERIAL_LINK = "serial_link"


#: What no instance may be called.
_RESERVED = ("controller", "machine", "channels", "actuators")
#: Of an instance.
_OPTIONAL = ("parameters", "inputs", "integrator", "tolerances")


@dataclass(frozen=True)
class SimConfig:
    """A checked simulation. `tables` maps each instance to its model, in update order.

    `controller` is the name of the first controller, `machine_file` its JSON (None if it came compiled), `companions` are those
    beside it. `ros` lists the standard messages
    onto which truth is mapped; `until` is the stop condition as text, empty without one; `warnings` are rendered texts.
    `arguments` are those of `load`, besides path, seed and duration: another file is read as this one was.
    """

    path: Path
    plan: Plan
    tables: dict[str, ModelTable]
    controller: str
    machine: Machine
    library: Path
    machine_file: Path | None
    companions: dict[str, Controller]
    seed: int
    ticks: int
    ros: tuple[TruthTopic, ...]
    until: str
    warnings: tuple[str, ...]
    arguments: dict[str, Any]

    @property
    def machines(self) -> dict[str, Machine]:
        """Those of all controllers by name; the first one leads."""
        return {self.controller: self.machine, **{name: other.machine for name, other in self.companions.items()}}

    def with_seed(self, seed: int) -> SimConfig:
        """The same with another seed, without reading the file again: for many runs."""
        return replace(self, seed=seed, plan=self.plan.flown_with(seed, {}))


@dataclass(frozen=True)
class Controller:
    """A hosted machine. Its commands act `delay_ticks` of its ticks after they are made."""

    machine: Machine
    library: Path
    delay_ticks: int


@dataclass
class _Parts:
    """The parts read so far; missing ones were reported."""

    models: dict[str, ModelTable | None] = field(default_factory=dict)
    instances: dict[str, Instance] = field(default_factory=dict)
    #: By name; the first one leads.
    controllers: dict[str, Controller] = field(default_factory=dict)
    integrator: Integrator | None = None
    seed: int | None = None
    ticks: int | None = None
    #: Of the command line, for parameters of controllers.
    controller_values: dict[Target, Value] = field(default_factory=dict)

    @property
    def machines(self) -> dict[str, Machine]:
        return {name: controller.machine for name, controller in self.controllers.items()}

    @property
    def machine(self) -> Machine | None:
        """That of the first controller."""
        return next(iter(self.machines.values()), None)

    @property
    def tick_hz(self) -> int | None:
        """Of a grid on which the ticks of all controllers lie."""
        return math.lcm(*(machine.tick_hz for machine in self.machines.values())) if self.controllers else None


def load(
    path: str | Path,
    *,
    seed: int | None = None,
    duration_s: Fraction | None = None,
    sets: Sequence[str] = (),
    events: Sequence[str] = (),
    machine: tuple[Path, str] | None = None,
    backend: str = DEFAULT_BACKEND,
    parameters: Given | None = None,
) -> SimConfig:
    """Reads and checks a `*.sim.json`, compiles its models and its machine (both cached).

    path: of the file, or package://<ROS package>/<path below its share folder>.
    seed, duration_s: replace the file's. sets: `instance.parameters.name=value`, or an element of it, of a model or of a controller. events, beside
    the file's: `14.0 instance.parameters.name=value`. machine: library and name of a compiled controller, which
    replaces the file's. backend: language (BACKENDS) into which the file's machines are compiled. parameters: with which
    the controllers begin. Raises
    DiagnosticError with all errors of the file, or SimError if the file or the simulator is missing.
    """
    try:
        file = resolve_source(str(path), config=Path()) if str(path).startswith("package://") else Path(path)
        source = SourceFile.read(file, str(path))
    except SourcePathError as error:
        raise SimError(f"{path}: {error}") from None
    except SourceError as error:
        raise SimError(f"{path}: {error}") from None
    try:
        values = read_parameters(parameters)
    except TwinError as error:
        raise SimError(str(error)) from None
    sink = DiagnosticSink()
    root = read_extended(source, sink)
    sink.raise_if_failed()
    assert root is not None
    _refuse_others(file, root)
    root = with_events(root, events, sink)
    if machine is None:
        _require_compiler()
    arguments = {"sets": sets, "events": events, "machine": machine, "backend": backend, "parameters": values}
    return _Loader(file, sink, arguments).load(root, seed, duration_s)


def _refuse_others(file: Path, root: JsonNode) -> None:
    """Raises SimError if a file is a machine or a study, by its content."""
    keys = root.members.keys() if root.kind == "object" else {"models"}
    if "models" in keys:
        return
    if {"simulation", "design"} <= keys:
        raise SimError(f"{file}: this is a study, not a simulation; `fcsl campaign {file}` flies it")
    if {"tick_hz", "states"} <= keys:
        fix = f'name a simulation whose `controller` is {{"machine": "{file.name}"}}, such as {file.stem}.sim.json'
        raise SimError(f"{file}: this is a machine, not a simulation; {fix}; `fcsl check {file}` checks it alone")


def _require_compiler() -> None:
    """Raises SimError where no C compiler is: one error, not one at each place that needs it."""
    try:
        toolchain()
    except ToolchainError as error:
        raise SimError(str(error)) from None


def _duration_problem(duration_s: Fraction, tick_hz: int) -> str | None:
    """The reason why a duration is invalid; None if it is valid."""
    text = f"{float(duration_s):g} s"
    if duration_s <= 0:
        return f"{text} is not above zero"
    if duration_s > MAX_SECONDS:
        return f"{text} is more than {MAX_SECONDS:g} s"
    if duration_s * tick_hz > MAX_TICKS:
        return f"{text} is more than {MAX_TICKS:g} ticks (1/{tick_hz} s)"
    try:
        whole_ticks(duration_s, tick_hz)
    except ValueError as error:
        return str(error)
    return None


def _plant_only(tick_hz: int) -> tuple[Path, str]:
    built = build_plant_only(tick_hz)
    return built.library, built.name


class _Loader:
    def __init__(self, file: Path, sink: DiagnosticSink, arguments: dict[str, Any]):
        self.file, self.sink, self.arguments = file, sink, arguments
        self.given_machine: tuple[Path, str] | None = arguments["machine"]
        self.backend: str = arguments["backend"]
        self.reader = ConfigReader(sink)
        self.parts = _Parts()
        self.link_node: JsonNode | None = None
        self.machine_files: dict[Path, Path] = {}  # JSON of each library that was built
        self.foreign: list[Diagnostic] = []  # diagnostics of the machine's files
        self.settings = Settings(arguments["sets"], sink)

    def load(self, root: JsonNode, seed: int | None, duration_s: Fraction | None) -> SimConfig:
        required = ("models", "instances", "integrator", "seed", "duration")
        optional = (
            "controller",
            "controllers",
            "constants",
            "tick_hz",
            "connections",
            "rates",
            "events",
            "until",
            "ros",
            "views",
            *FOR_READERS,
        )
        keys = self.reader.object(root, "a simulation", required, optional)
        if keys is None:
            raise DiagnosticError(self.sink.diagnostics)
        if "constants" in keys:
            at = file_of(keys["constants"].span)  # of a base, if that has them
            self.reader.constants = read_constants(keys["constants"], at, self.reader, outside=True)
        for key in FOR_READERS:
            self.reader.string(keys.get(key), f"`{key}`")
        parts = self.parts
        if self._has_controller(root, keys):
            self._read_controllers(keys)
        parts.integrator = read_integrator(keys.get("integrator"), self.reader, parts.tick_hz)
        self._read_models(keys.get("models"))
        self._read_instances(keys.get("instances"))
        link = self._read_link(self.link_node)
        file_seed = self.reader.integer(keys.get("seed"), "`seed`", 0, 2**64 - 1)
        parts.seed = file_seed if seed is None else seed
        self._read_duration(keys.get("duration"), duration_s)
        self._read_controller_settings()
        self._report_unused_settings()
        # A shorter duration on the command line is intended; in the file, an event after the end is probably a mistake.
        file_ticks = parts.ticks if duration_s is None else None
        wiring = check_wiring(self.reader, parts.instances, parts.machines, parts.integrator, keys, file_ticks)
        views = read_views(keys.get("views"), self._signals(), self.file, self.reader)
        if self.foreign or self.sink.failed:
            raise DiagnosticError([*self.foreign, *(d for d in self.sink.diagnostics if d.severity is Severity.ERROR)])
        return self._finish(wiring, views, link)

    def _finish(self, wiring: Wiring, views: str, link: str | None) -> SimConfig:
        """Assembles the result; called only without errors, so every part is present."""
        parts = self.parts
        assert parts.machine and parts.ticks and parts.seed is not None
        controller, lead = next(iter(parts.controllers.items()))
        tables = {name: parts.instances[name].table for name in wiring.order}
        used = {table.name: table for table in tables.values() if table}
        lines = [
            plan.library_statement("machine", lead.machine.name, library=lead.library),
            *([plan.statement("delay", lead.delay_ticks)] if lead.delay_ticks else []),
            *(
                plan.library_statement("companion", name, other.delay_ticks, other.machine.name, library=other.library)
                for name, other in list(parts.controllers.items())[1:]
            ),
            plan.statement("seed", parts.seed),
            plan.statement("ticks", parts.ticks),
            *(
                plan.library_statement("machine_model" if table.tick_hz else "model", name, library=table.library)
                for name, table in sorted(used.items())
            ),
            *wiring.statements,
            *([plan.statement("serial_link", link)] if link else []),
            *([plan.statement("views", views)] if views else []),
        ]
        found = {name: table for name, table in tables.items() if table}
        flown = Plan(tuple(lines), self.arguments["parameters"])
        if parts.controller_values:
            values = StartValues(flown, found, parts.machines).with_values(parts.controller_values)
            flown = replace(flown, parameters=values)
        return SimConfig(
            self.file,
            flown,
            found,
            controller,
            lead.machine,
            lead.library,
            self.machine_files.get(lead.library),
            dict(list(parts.controllers.items())[1:]),
            parts.seed,
            parts.ticks,
            wiring.ros,
            wiring.until,
            tuple(d.render() for d in self.sink.diagnostics if d.severity is Severity.WARNING),
            self.arguments,
        )

    # ---- controller and time ------------------------------------------------------------------------------------------

    def _has_controller(self, root: JsonNode, keys: dict[str, JsonNode]) -> bool:
        """False: the simulation says its `tick_hz` instead, and runs with a machine that does nothing."""
        if "tick_hz" not in keys:
            if "controller" not in keys and "controllers" not in keys:
                fix = 'add `"controller": …`, or `"tick_hz": 100` for a simulation of the plant alone'
                self.sink.error("E202", "a simulation has no `controller`", root.span, help=fix)
            return True
        if "controller" in keys or "controllers" in keys:
            fix = "remove `tick_hz`; it is for a simulation without a controller"
            self.sink.error("E201", "`tick_hz` is that of the controller", keys["tick_hz"].span, help=fix)
            return True
        tick_hz = self.reader.integer(keys["tick_hz"], "`tick_hz`", 1, MAX_TICK_HZ)
        if tick_hz is not None:
            self._use_machine("controller", lambda: _plant_only(tick_hz), "plant_only", keys["tick_hz"].span)
        return False

    def _read_controllers(self, keys: dict[str, JsonNode]) -> None:
        """`controller`, or several by name, of which the first one leads: the simulation's ticks are its own."""
        if "controllers" not in keys:
            self._read_controller("controller", keys.get("controller"), self.given_machine)
            return
        if "controller" in keys:
            fix = "write all of them into `controllers`"
            self.sink.error("E201", "both `controller` and `controllers`", keys["controller"].span, help=fix)
        given = self.given_machine
        for name, (definition, span) in self.reader.named(keys["controllers"], "`controllers`").items():
            if name in _RESERVED[1:]:
                self.sink.error("E209", f"`{name}` is reserved", span, help="give the controller another name")
            self._read_controller(name, definition, given)
            given = None
        if not self.parts.controllers and not (self.sink.failed or self.foreign):
            self.sink.error("E202", "`controllers` is empty", keys["controllers"].span)

    def _read_controller(self, name: str, node: JsonNode | None, given: tuple[Path, str] | None) -> None:
        first = not self.parts.controllers
        optional = ("link", "delay_ticks") if first else ("delay_ticks",)
        what = f"`{name}`" if name == "controller" else f"controller `{name}`"
        keys = self.reader.object(node, what, ("machine",), optional) if node else None
        if first:
            self.link_node = keys.get("link") if keys else None
        delay = keys.get("delay_ticks") if keys else None
        delay_ticks = self.reader.integer(delay, "`delay_ticks`", 0, MAX_DELAY_TICKS) if delay else 0
        machine = keys.get("machine") if keys else None
        text = self.reader.string(machine, "`machine`")
        if machine is None or text is None:
            return
        config = file_of(machine.span)
        self._use_machine(
            name, lambda: given or self._build_machine(text, config), text, machine.span, delay_ticks or 0
        )

    def _use_machine(
        self, controller: str, build: Callable[[], tuple[Path, str]], text: str, span: Span, delay_ticks: int = 0
    ) -> None:
        """Opens the machine that `build` gives: its library, and its name within that."""
        try:
            library, name = build()
            run = open_run(library, name)
            self.parts.controllers[controller] = Controller(run.machine, library, delay_ticks)
            run.close()
        except DiagnosticError as error:
            self.foreign.extend(error.diagnostics)
        except (SourcePathError, ToolchainError, TwinError) as error:
            self.sink.error("E802", f"the machine `{text}` cannot be used: {error}", span)

    def _build_machine(self, text: str, config: Path) -> tuple[Path, str]:
        """Unlike sources, a machine may be outside of the folder of the file `config` that names it; otherwise the same
        rules apply."""
        path = resolve_source(text, config=config) if text.startswith("package://") else config.parent / text
        if not path.is_file():
            raise SourcePathError(f"no such file: {path}")
        built = build_machine(path, backend=self.backend)
        self.machine_files[built.library] = path
        return built.library, built.name

    def _read_duration(self, node: JsonNode | None, given_s: Fraction | None) -> None:
        duration_s = seconds(self.reader, node, "`duration`")
        if given_s is not None:
            duration_s = given_s
        if duration_s is None or node is None or self.parts.machine is None:
            return
        problem = _duration_problem(duration_s, self.parts.machine.tick_hz)
        if problem is None:
            self.parts.ticks = int(duration_s * self.parts.machine.tick_hz)
        elif given_s is not None:
            raise SimError(f"duration: {problem}")
        else:
            self.sink.error("E805", problem, node.span)

    def _signals(self) -> Signals:
        """What `views` may name: fields of the controller's instances and of the models."""
        machine, instances = self.parts.machine, self.parts.instances
        known: dict[str, dict[str, tuple[Type, str]]] = {i.name: {} for i in machine.instances} if machine else {}
        for f in machine.fields.values() if machine else ():
            if f.role in ("input", "output", "parameter", "state"):
                known[f.instance][f.path.removeprefix(f"{f.instance}.")] = type_of(f.type, f.shape), f.unit
        for name, instance in instances.items():
            fields = instance.table.fields.values() if instance.table else ()
            known[name] = {f.path: (f.type, f.unit) for f in fields}
        incomplete = {name for name, instance in instances.items() if instance.table is None}
        return Signals(known, incomplete if machine else Everything())

    # ---- models -------------------------------------------------------------------------------------------------------

    def _read_models(self, node: JsonNode | None) -> None:
        libraries: dict[str, Path] = {}
        for name, (definition, span) in self.reader.named(node, "`models`").items():
            self.parts.models[name] = None
            keys = self.reader.object(definition, f"model `{name}`", (), ("source", "library", "machine"))
            if keys is None:
                continue
            if len(keys) != 1:
                has = (
                    f"has {' and '.join(f'`{key}`' for key in keys)}"
                    if keys
                    else "has none of `source`, `library` and `machine`"
                )
                fix = (
                    'write {"source": "cart.c"} for a file in C or C++, {"library": "package://PACKAGE/NAME"} for one of a '
                    'package, or {"machine": "gust.json"} for an algorithm'
                )
                self.sink.error("E801", f"model `{name}` {has}", span, help=fix)
                continue
            ((key, place),) = keys.items()
            table = self._compile(key, place)
            if table and libraries.setdefault(table.name, table.library) != table.library:
                self.sink.error("E801", f"two different models are called `{table.name}`", place.span)
            else:
                self.parts.models[name] = table

    def _compile(self, key: str, node: JsonNode) -> ModelTable | None:
        form = {"source": "cart.c", "library": "package://PACKAGE/NAME", "machine": "gust.json"}[key]
        text = self.reader.string(node, f"`{key}`", form)
        if text is None:
            return None
        if key == "machine":
            return self._machine_model(text, node.span)
        try:
            if key == "library":
                return model_library(text)
            table = model_source(text, file_of(node.span))
            self._warn_of_time(table, text, node.span)
            return table
        except SimError as error:
            reason, _, output = str(error).partition("\n")
            reason = reason.removesuffix(":")
            self.sink.error("E801", f"the model `{text}` cannot be used: {reason}", node.span, output=output)
            return None

    def _warn_of_time(self, table: ModelTable, text: str, span: Span) -> None:
        line = None if table.has_next_time else time_comparison(source_text(text, file_of(span)))
        if line is not None:
            message = f"`{text}` compares its time in line {line}, and announces no times at which it jumps"
            why = "a step of the integrator that reaches over a jump takes it for a smooth slope"
            self.sink.warning("W805", message, span, why=why, help="give the model a function `next_time`")

    def _machine_model(self, text: str, span: Span) -> ModelTable | None:
        """A machine with one instance: its algorithm is the model."""
        try:
            return machine_model(*self._build_machine(text, file_of(span)))
        except DiagnosticError as error:
            self.foreign.extend(error.diagnostics)
        except (SimError, SourcePathError, ToolchainError, TwinError) as error:
            self.sink.error("E801", f"the machine `{text}` cannot be used as a model: {error}", span)
        return None

    # ---- instances ----------------------------------------------------------------------------------------------------

    def _read_instances(self, node: JsonNode | None) -> None:
        for name, (definition, span) in self.reader.named(node, "`instances`").items():
            if name in self._taken():
                what = f"an instance of machine `{self.parts.machine.name}`" if self.parts.machine else ""
                what = "a controller" if name in self.parts.controllers else what
                what = "reserved" if name in _RESERVED else what
                self.sink.error("E209", f"`{name}` is {what}", span, help="give the instance another name")
                self.parts.instances[name] = Instance(name, span, None)  # so that its uses are no further errors
                continue
            keys = self.reader.object(definition, f"instance `{name}`", ("model",), _OPTIONAL) or {}
            model = self.reader.string(keys.get("model"), "`model`")
            instance = Instance(name, span, None)
            self.parts.instances[name] = instance
            if model is None or self.reader.reference(keys["model"], "model", list(self.parts.models)) is None:
                continue
            instance.table = self.parts.models[model]
            if instance.table:
                self._read_parameters(instance, instance.table, keys.get("parameters"))
                self._read_inputs(instance, instance.table, keys.get("inputs"))
                self._read_tolerances(instance, instance.table, keys.get("tolerances"))
                instance.integrator = read_integrator(keys.get("integrator"), self.reader, self.parts.tick_hz)

    def _taken(self) -> set[str]:
        """Names that paths of the simulation already begin with."""
        machine = self.parts.machine
        names = {instance.name for instance in machine.instances} if machine else set()
        return names | set(_RESERVED) | set(self.parts.controllers)

    def _read_parameters(self, instance: Instance, table: ModelTable, node: JsonNode | None) -> None:
        wanted = {f.name: f for f in table.of_role("parameter")}
        given = self._values(instance, table, "parameter", node)
        needed = {name: f for name, f in wanted.items() if name not in given and not f.optional}
        missing = [f"`{name}` ({with_unit(f.type, f.unit)})" for name, f in needed.items()]
        if missing and not table.tick_hz:
            message = f"parameter {', '.join(missing)} of `{instance.name}` has no value"
            self.sink.error(
                "E211", message, instance.span, help="only optional ones may be left out, and are zero then"
            )
        for name, (definition, _) in given.items():
            self._set(instance, wanted[name], definition)
        for left_out in (f for name, f in wanted.items() if name not in given and f.optional):
            self._set_scalars(instance, left_out, [0] * count_of(left_out.type))

    def _read_inputs(self, instance: Instance, table: ModelTable, node: JsonNode | None) -> None:
        """Values of inputs that no connection feeds."""
        fields = {f.name: f for f in table.of_role("input")}
        for name, (definition, span) in self._values(instance, table, "input", node).items():
            instance.given[fields[name].path] = span
            self._set(instance, fields[name], definition)

    def _values(
        self, instance: Instance, table: ModelTable, role: str, node: JsonNode | None
    ) -> dict[str, tuple[JsonNode, Span]]:
        """What the file and the command line give to parameters or inputs, by name."""
        wanted = [f.name for f in table.of_role(role)]
        given: dict[str, tuple[JsonNode, Span]] = {}
        for name, (definition, span) in self.reader.named(node, f"`{role}s` of `{instance.name}`").items():
            if name in wanted:
                given[name] = definition, span
                continue
            hint = nearest(name, wanted) or (f"it has {', '.join(wanted)}" if wanted else "it has none")
            code = "E210" if role == "parameter" else "E216"
            self.sink.error(code, f"model `{table.name}` has no {role} `{name}`", span, help=hint)
        for name in wanted:
            setting = self.settings.take_whole(f"{instance.name}.{role}s.{name}")
            if setting:
                given[name] = setting.value, setting.span
        return given

    def _read_tolerances(self, instance: Instance, table: ModelTable, node: JsonNode | None) -> None:
        """Absolute tolerances of continuous states, for rk45."""
        states = table.continuous()
        if node is not None and node.kind != "object":
            self.reader.wrong(node, "`tolerances` is an object from state to tolerance", '{"state.position": 1e-6}')
            return
        for path, member in node.members.items() if node else ():
            definition, span = member.value, member.key_span
            if path not in states:
                hint = nearest(path, list(states)) or (f"it has {', '.join(states)}" if states else "it has none")
                self.sink.error("E216", f"`{instance.name}` has no continuous state `{path}`", span, help=hint)
                continue
            value = self.reader.number(definition, "a tolerance", 1e-300, 1e300)
            if value is not None:
                bits = plan.bits("f64", value)
                instance.tolerances += [plan.statement("tolerance", instance.name, i, bits) for i in states[path]]

    def _set(self, instance: Instance, target: ModelField, node: JsonNode) -> None:
        if target.table:
            scalars: Sequence[bool | int | float | str] | None = read_table(node, target, self.reader)
        else:
            scalars = self.reader.value(node, target.type, f"{target.role} `{target.name}`", target.unit)
        self._set_scalars(instance, target, scalars)

    def _set_scalars(
        self, instance: Instance, target: ModelField, scalars: Sequence[bool | int | float | str] | None
    ) -> None:
        elements = self.settings.take_elements(f"{instance.name}.{target.path}")
        for i, value in enumerate(with_elements(scalars, target, elements, self.reader) if scalars else ()):
            value_bits = plan.bits(scalar_of(target.type).name, value)
            instance.sets.append(plan.statement("set", instance.name, target.path, i, value_bits))

    def _read_link(self, node: JsonNode | None) -> str | None:
        """The instance between plant and controller; None: they meet directly, or an error was reported."""
        name = self.reader.string(node, "`link`")
        if node is None or name is None:
            return None
        links = [i.name for i in self.parts.instances.values() if i.table and i.table.name == SERIAL_LINK]
        instance = self.parts.instances.get(name)
        if name in links or (instance and instance.table is None):
            return name  # an error in its model was reported
        what = f"is of the model `{instance.table.name}`" if instance and instance.table else "is no instance"
        fix = f"there is `{links[0]}`" if links else f"add an instance of package://fcsl_sim/models/{SERIAL_LINK}.c"
        self.sink.error("E806", f"`{name}` {what}, not of `{SERIAL_LINK}`", node.span, help=fix)
        return None

    # ---- command line ---------------------------------------------------------------------------------------------------

    def _read_controller_settings(self) -> None:
        for path, parameter in controller_parameters(self.parts.machines).items() if self.settings.left() else ():
            whole, elements = self.settings.take_whole(path), self.settings.take_elements(path)
            spans = [setting.span for setting in (whole, *elements) if setting]
            if not spans or not parameter.is_settable(path, spans[0], self.sink):
                continue
            given: Sequence[Value | None] = [None] * parameter.field.count
            if whole:
                what = f"parameter `{parameter.shown.name}`"
                given = self.reader.value(whole.value, parameter.shown.type, what, parameter.shown.unit) or given
            changed = with_elements(given, parameter.shown, elements, self.reader)
            values = {(*parameter.target, str(i)): value for i, value in enumerate(changed) if value is not None}
            if parameter.is_in_range(list(values.values()), path, spans[0], self.sink):
                self.parts.controller_values.update(values)

    def _report_unused_settings(self) -> None:
        instances = self.parts.instances
        for path, span in ((setting.path, setting.span) for setting in self.settings.left()):
            name = path.partition(".")[0]
            if name in instances and instances[name].table is None:
                continue  # the error in its model was reported
            tables = {i.name: i.table for i in instances.values() if i.table}
            fields = {f"{i}.{f.path}": f for i, table in tables.items() for f in table.of_role("parameter", "input")}
            if path in fields:  # an element; a whole field was taken
                fix = f"give it one: in `{fields[path].role}s` of `{name}`, or by `--set {path}=[…]`"
                self.sink.error("E211", f"`{path}` has no value of which an element can be set", span, help=fix)
                continue
            fix = nearest(path, [*fields, *controller_parameters(self.parts.machines)])
            if self.parts.machine and path in self.parts.machine.fields:
                fix = "`--set` sets parameters, and inputs of models; `SimTwin.set` sets other values of a machine"
            self.sink.error("E210", f"there is no parameter or input `{path}`", span, help=fix)
