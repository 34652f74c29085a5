# SPDX-License-Identifier: Apache-2.0
"""Makes all code of a machine (model/code.py), which printers write."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..lower.structural_zeros import PRODUCTS
from ..model import code, ir
from ..model.c_names import c_name
from ..model.machine import Machine, Values
from ..model.types import Array, Struct, Type
from .cold_paths import ColdPathEmitter
from .expressions import code_type
from .fault_places import FaultPlaces
from .functions import FunctionEmitter
from .identical_code_folding import first_identical
from .inline_size import inlined_functions
from .instances import InstanceEmitter, nested
from .names import constant_name, record_type, request_constant, state_constant
from .records import records, result_records
from .stack_bytes import stack_bytes
from .status_elision import quiet_instances
from .step import StepEmitter
from .straight_line import written_out


def emit_machine(machine: Machine, places: FaultPlaces, times: bool = False) -> code.Program:
    """`machine`: lowered. `places`: of its faults. `times`: the host measures each instance."""
    quiet = quiet_instances(machine)
    firsts = first_identical(machine, quiet)
    functions = tuple(_functions(machine, places, quiet, firsts, times))
    used = set().union(*(code.used_names(f.body) for f in functions))
    described, private = tuple(records(machine, firsts)), tuple(result_records(machine))
    return code.Program(
        name=machine.name,
        source=machine.config.name,
        states=tuple(state_constant(machine, n).text for n in range(len(machine.states))),
        requests=tuple(request_constant(machine.name, name) for name in ("", *machine.requests)),
        records=described,
        private_records=private,
        externs=tuple(_extern(machine, e) for e in machine.externs),
        tables=tuple(_tables(machine, used)),
        functions=functions,
        uses_hardware=any(f.uses_hardware for f, _ in machine.entries),
        has_events=any(f.has_events for f, _ in machine.entries),
        stack_bytes=stack_bytes((*described, *private), functions, f"fcsl_step_{machine.name}"),
    )


def _functions(
    machine: Machine, places: FaultPlaces, quiet: frozenset[int], firsts: Sequence[int], times: bool
) -> Iterator[code.Function]:
    inlined = inlined_functions(machine)
    bodies: dict[str, code.Function] = {}
    for function, owner in machine.emitted:
        types = {r: record_type(machine, owner, r) for r in ir.RECORDS} if owner else {}
        made = FunctionEmitter(function, machine.name, places, types, function.name in inlined).emit()
        if owner is not None and not function.faults and not _is_dense(machine, function):
            made = written_out(made, _fields(machine, owner), bodies) or made
        bodies[made.name] = made
    yield from _called(bodies, machine)
    yield from ColdPathEmitter(machine, places, quiet).emit()
    for index, (instance, first) in enumerate(zip(machine.instances, firsts, strict=True)):
        yield from InstanceEmitter(machine, instance, index in quiet, machine.instances[first]).emit()
    yield from StepEmitter(machine, quiet, firsts, times).emit()


def _is_dense(machine: Machine, function: ir.Function) -> bool:
    """Whether it multiplies matrices of which none is constant. As loops, the operations of such products are
    vectors."""
    callees = [machine.program.functions[name] for name in function.calls]
    products = [f for f in callees if f.source_name in PRODUCTS - {"matvec"}]
    return bool(products) and all(len(f.arguments) == 2 for f in products)  # a constant is no argument


def _fields(machine: Machine, algorithm: ir.Algorithm) -> dict[tuple[str, str], code.Type]:
    """The types of the fields of an algorithm by record and name."""
    ports = ((record, port) for record, ports in algorithm.ports.items() for port in ports)
    return {(record, c_name(port.name)): code_type(machine.name, port.type) for record, port in ports}


def _called(functions: dict[str, code.Function], machine: Machine) -> Iterator[code.Function]:
    """The functions of algorithms, and those that they call. Callees come first."""
    used = {function.name for function, owner in machine.emitted if owner is not None}
    for name in reversed(functions):
        if name in used:
            used |= code.used_functions(functions[name].body)
    return (function for name, function in functions.items() if name in used)


def _extern(machine: Machine, e: ir.Extern) -> code.Prototype:
    arguments = [_parameter(machine, type_) for _, type_ in e.arguments]
    result = None if e.result is None else _parameter(machine, e.result, writable=True)
    if isinstance(result, code.Pointer):
        arguments.append(result)
        result = None
    return code.Prototype(e.name, e.header, tuple(arguments), result, e.span, e.language)


def _parameter(machine: Machine, type_: Type, writable: bool = False) -> code.Type:
    made = code_type(machine.name, type_)
    return code.Pointer(made, writable) if isinstance(type_, Array | Struct) else made


def _tables(machine: Machine, used: set[str]) -> Iterator[code.Table]:
    """Constants of modules with storage, and frozen parameters, that functions use."""
    for (owner, name), (type_, values) in machine.program.constants.items():
        if constant_name(owner, name) in used:
            yield _table(machine, owner, name, type_, values)
    for instance in machine.instances:
        owner = f"{instance.algorithm.owner}__{instance.identifier}"
        for port in instance.algorithm.ports["parameters"]:
            if port.name in instance.frozen and constant_name(owner, port.name) in used:
                yield _table(machine, owner, port.name, port.type, instance.parameters[port.name])


def _table(machine: Machine, owner: str, name: str, type_: Type, values: Values) -> code.Table:
    return code.Table(constant_name(owner, name), code_type(machine.name, type_), nested(machine, type_, iter(values)))
