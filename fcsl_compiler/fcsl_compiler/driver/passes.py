# SPDX-License-Identifier: Apache-2.0
"""The compiler driver: a table of named passes. `fcsl build --dump PASS` prints the result of each."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.files import digest
from ..base.source import Span
from ..check.verify import verify_machine
from ..config.machine import check_machine
from ..config.schedule import schedule
from ..config.strict import check_strict
from ..config.subset_machine import subset_machine
from ..coverage.instrument import instrument
from ..coverage.probes import C_OPERATIONS, prelude
from ..coverage.settings import BUILD_NOTE
from ..emit.collisions import check_collisions
from ..emit.fault_places import FaultPlaces
from ..emit.field_table import source_hash
from ..emit.machine import emit_machine
from ..lower.lower import lower
from ..model.choices import DEFAULT_BACKEND, DEFAULT_TARGET, TIMES
from ..model.machine import Machine
from ..model.target import Target
from ..parse.machine_files import ParsedMachine, parse_machine
from ..parse.targets import choose_target
from ..printers.c.descriptor import DescriptorEmitter
from ..printers.c.header import print_header
from ..printers.c.source import print_source
from ..printers.c.writer import CWriter
from ..printers.nim.module import print_module
from ..printers.source_map import source_map
from ..printers.writer import Writer
from ..requirements.effects import acting, check_effects, with_effects
from ..requirements.monitor import Monitor, subset_of
from ..requirements.read import read_requirements
from ..requirements.requirement import Requirement
from ..requirements.services import check_services
from .c_dependencies import CInputs, extern_inputs
from .dump import dump_c, dump_ir, dump_machine, dump_schedule, dump_syntax, dump_types


@dataclass
class Compilation:
    """Data that one pass hands to the next."""

    path: Path
    toolchain: str  # compiler version and flags, part of build_hash
    strict: bool = False
    target_name: str = DEFAULT_TARGET
    instances: Sequence[str] | None = None  # of a subset machine
    sink: DiagnosticSink = field(default_factory=DiagnosticSink)
    parsed: ParsedMachine | None = None
    machine: Machine | None = None
    lowered: Machine | None = None
    target: Target = field(default_factory=lambda: Target(DEFAULT_TARGET))
    c_inputs: CInputs = field(default_factory=CInputs)  # what the externs of the target are compiled from
    header: str = ""
    source: str = ""
    map: str = ""
    build_hash: str = ""
    stack_bound: int | None = None  # stack of step in bytes, after compiling; None if unknown
    cover: bool = False  # True for a coverage build, which must not fly
    times: bool = False  # True for a build of which the host measures each instance
    folds: bool = True  # hosts make the fields of instances that are alike; firmware has no memory for them
    backend: str = DEFAULT_BACKEND  # language of the source (BACKENDS)
    extern_calls: tuple[str, ...] = ()  # functions called by the externs' own code, known after linking
    requirements_file: Path | None = None  # instead of the machine's own requirements
    requirements: list[Requirement] = field(default_factory=list)
    effects: list[Requirement] = field(default_factory=list)  # those of its own that act on the machine
    monitor: Monitor | None = None  # None without requirements
    monitor_code: Compilation | None = None  # of the monitor

    @property
    def source_name(self) -> str:
        return f"{self.checked.name}.{self.backend}"

    @property
    def c_name(self) -> str:
        """The C file that is compiled: what a printer wrote, or what Nim makes of it."""
        return self.source_name if self.backend == "c" else f"{self.source_name}.c"

    @property
    def checked(self) -> Machine:
        assert self.machine is not None
        return self.machine

    @property
    def c_names(self) -> tuple[str, ...]:
        """The C files of the machine and of its monitor."""
        return (self.c_name, *((self.monitor_code.c_name,) if self.monitor_code is not None else ()))


def _parse(c: Compilation) -> None:
    c.parsed = parse_machine(c.path, c.sink)


def _check(c: Compilation) -> None:
    if c.parsed is not None:
        c.machine = check_machine(c.parsed, c.sink)
    if c.parsed is not None and c.machine is not None:
        own = read_requirements(c.parsed, c.machine, None, c.sink)
        if not c.sink.failed:
            check_effects(own, c.machine, _guards(c.parsed), c.sink)
        c.requirements = own
        if c.requirements_file is not None:
            c.requirements = read_requirements(c.parsed, c.machine, c.requirements_file, c.sink)
        c.effects = acting(own, c.machine)
        check_services(c.machine, c.sink)
    if c.strict and c.machine is not None:
        check_strict(c.machine, c.sink)


def _guards(parsed: ParsedMachine) -> dict[str, Span]:
    """Where transitions name requirements, by id."""
    named = (
        [item.get("requirement") for item in parsed.keys["transitions"].items] if "transitions" in parsed.keys else []
    )
    return {str(node.value): node.span for node in named if node is not None and node.kind == "string"}


def _verify(c: Compilation) -> None:
    verify_machine(c.checked)


def _schedule(c: Compilation) -> None:
    c.machine = schedule(c.checked, c.sink)
    check_collisions(c.machine, c.sink)
    # Errors are reported for the whole machine; the order is that of the subset.
    if c.instances is not None and not c.sink.failed:
        assert c.parsed is not None
        c.machine = subset_machine(c.machine, c.instances, c.parsed.keys["instances"].span, c.sink)
        if c.machine is not None:
            c.effects = acting(subset_of(c.effects, c.machine), c.machine)
            c.requirements = subset_of(c.requirements, c.machine)
    if c.machine is not None and not c.sink.failed:
        c.machine = with_effects(c.machine, c.effects)
        check_collisions(c.machine, c.sink)


def _lower(c: Compilation) -> None:
    c.lowered = lower(c.checked)
    verify_machine(c.lowered)


def _emit(c: Compilation) -> None:
    m, lowered = c.checked, c.lowered
    assert c.parsed is not None and lowered is not None
    at = c.parsed.keys["targets"].span if "targets" in c.parsed.keys else m.config.whole()
    c.target = choose_target(m.targets, c.target_name, at)
    covered = instrument(m, str(c.path.resolve())) if c.cover else None
    if covered is not None:
        verify_machine(covered.machine)
        lowered = lower(covered.machine)
    c.c_inputs = extern_inputs(c.parsed, c.target)
    linked = (*c.target.digest_parts, *c.c_inputs.digest_parts)
    notes = (*([BUILD_NOTE] if covered else []), *([TIMES] if c.times else []))
    c.build_hash = digest(source_hash(m), c.toolchain, *linked, *notes)
    places = FaultPlaces(lowered)
    program = emit_machine(lowered, places, c.times)

    def describe(to: CWriter) -> None:
        DescriptorEmitter(m, to, c.build_hash, places, program.stack_bytes, c.times, c.folds).emit()

    w: Writer
    if c.backend == "nim":
        w = print_module(program, describe)
    else:
        w = print_source(program, prelude(covered.map) if covered is not None else "", C_OPERATIONS)
        describe(w)
    c.header, c.source, c.map = print_header(program), w.text(), source_map(program, w, c.source_name)


@dataclass(frozen=True)
class Pass:
    name: str
    what: str
    run: Callable[[Compilation], None]
    dump: Callable[[Compilation], str]


PASSES: tuple[Pass, ...] = (
    Pass("parse", "read the machine and its algorithms", _parse, lambda c: dump_syntax(c.parsed)),
    Pass("check", "check types, resolve every name", _check, lambda c: dump_machine(c.checked)),
    Pass("schedule", "order every state by dataflow", _schedule, lambda c: dump_schedule(c.checked)),
    Pass("verify", "verify the checked program", _verify, lambda c: dump_ir(c.checked)),
    Pass("lower", "optimise the IR for C", _lower, lambda c: dump_ir(c.lowered or c.checked)),
    Pass("emit", "write the source", _emit, lambda c: dump_c(c.header, c.source)),
)

#: Values of `--dump`: a pass, or a result that is available after a pass; with the last pass to run.
DUMPS: dict[str, tuple[str, Callable[[Compilation], str]]] = {
    **{p.name: (p.name, p.dump) for p in PASSES},
    "types": ("check", lambda c: dump_types(c.checked)),
}


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """The passes make many values and few cycles of them: the collector would only walk them, again and again, in more than
    linear time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@_without_garbage_collection()
def compile_machine(
    path: Path,
    toolchain: str,
    until: str = "emit",
    strict: bool = False,
    target: str = DEFAULT_TARGET,
    cover: bool = False,
    instances: Sequence[str] | None = None,
    backend: str = DEFAULT_BACKEND,
    requirements: Path | None = None,
    times: bool = False,
    folds: bool = True,
) -> Compilation:
    """Runs the passes up to `until` (a name of PASSES). Raises DiagnosticError if the program has an error.

    `cover`: the C contains probes (coverage/instrument.py); backend "c" alone has them. `instances`: instances of a
    subset machine. `requirements`: a file of those that take the place of the machine's own. `times`: the host measures
    each instance. `folds`: hosts make the fields of instances that are alike (fcsl_folded_fields_t).
    """
    c = Compilation(path, toolchain, strict, target, instances, cover=cover, times=times, folds=folds, backend=backend)
    c.requirements_file = requirements
    for step in PASSES:
        step.run(c)
        # A syntax error in one file does not suppress errors in other files.
        if step.run is not _parse or until == step.name:
            c.sink.raise_if_failed()
        if step.name == until:
            break
    return c
