# SPDX-License-Identifier: Apache-2.0
"""The IR verifier. It runs between checking and code generation, so that a compiler defect is found at build time and
not in flight."""

from __future__ import annotations

from ..model import ir
from ..model.effects import can_fault
from ..model.events import MOST_VALUES, is_event_value, is_text
from ..model.literals import STRING_LITERAL
from ..model.machine import Machine
from ..model.types import BOOL, Array, Scalar, Struct, Type, shape_of


class IrError(AssertionError):
    """The compiler produced invalid IR. This is a defect of the compiler, not of the program."""


def verify_machine(machine: Machine) -> None:
    """Verifies all functions and schedules. Raises IrError at the first violated rule."""
    for function in machine.program.functions.values():
        _Verifier(function, machine, {}).run()
    for entry, algorithm in machine.entries:
        _Verifier(entry, machine, algorithm.ports).run()
    for state in machine.states:
        order = {e.instance: n for n, e in enumerate(state.entries)}
        for c in machine.connections:
            if not c.delayed and c.source.instance in order and c.target.instance in order:
                _rule(order[c.source.instance] < order[c.target.instance], f"order of state {state.name}")


def _rule(holds: bool, what: str) -> None:
    if not holds:
        raise IrError(f"internal error: {what} does not hold; please report the program that caused it")


class _Verifier:
    def __init__(self, function: ir.Function, machine: Machine, ports: dict[str, tuple[ir.Port, ...]]):
        self.f, self.machine, self.ports = function, machine, ports
        self.names = dict(function.arguments) | dict(function.locals)
        self.locals = {name for name, _ in function.locals}
        self.records = function.records
        self.ranges: set[str] = set()
        self.can_fault = False

    def run(self) -> None:
        self._body(self.f.body)
        _rule(self.can_fault == self.f.faults or self.f.faults, f"`faults` of {self.f.name}")

    def _body(self, statements: tuple[ir.Stmt, ...]) -> None:
        for s in statements:
            if isinstance(s, ir.Assign):
                _rule(self._place(s.target), f"target of {s.span}")
                _rule(self._type(s.value) == self._type(s.target), f"types of the assignment at {s.span}")
            elif isinstance(s, ir.Effect):
                arguments = tuple(t for _, t in s.function.arguments)
                _rule(tuple(map(self._type, s.args)) == arguments, f"arguments of {s.function.name} at {s.span}")
                _rule(not any(map(can_fault, s.args)), f"a fault inside the call of {s.function.name} at {s.span}")
                _rule((s.target is None) == (s.function.result is None), f"result of {s.function.name} at {s.span}")
                if s.target is not None:
                    _rule(self._place(s.target) and self._type(s.target) == s.function.result, f"target of {s.span}")
            elif isinstance(s, ir.Event):
                _rule(all(is_event_value(self._type(arg)) for arg in s.args), f"values of the event at {s.span}")
                _rule(len(s.args) <= MOST_VALUES and is_text(s.text), f"the event at {s.span}")
                _rule(not any(map(can_fault, s.args)), f"a fault inside the event at {s.span}")
            elif isinstance(s, ir.If):
                _rule(self._type(s.condition) == BOOL, f"condition at {s.span}")
                self._body(s.then)
                self._body(s.otherwise)
            elif isinstance(s, ir.For):
                _rule(s.step != 0 and s.variable not in self.ranges, f"loop at {s.span}")
                self._type(s.start)
                self._type(s.stop)
                self.ranges.add(s.variable)
                self._body(s.body)
                self.ranges.discard(s.variable)
            elif isinstance(s, ir.Return):
                _rule((s.value is None) == (self.f.result is None), f"return at {s.span}")
                if s.value is not None:
                    _rule(self._type(s.value) == self.f.result, f"result at {s.span}")

    def _place(self, e: ir.Place) -> bool:
        root = ir.root(e)
        if isinstance(root, ir.Field):
            return root.record in ("outputs", "state")
        return isinstance(root, ir.Local) and root.name in self.locals

    def _type(self, e: ir.Expr) -> Type:
        """Type of an expression, after verifying all its parts."""
        _rule(e.type is not STRING_LITERAL, f"a string without a type at {e.span}")
        _rule(not isinstance(e, ir.EffectCall), f"a call that reaches outside, in an expression at {e.span}")
        if isinstance(e, ir.Local):
            _rule(self.names.get(e.name) == e.type, f"type of {e.name} at {e.span}")
        elif isinstance(e, ir.RangeVar):
            _rule(e.name in self.ranges, f"loop variable {e.name} at {e.span}")
        elif isinstance(e, ir.Field):
            _rule(e.record in self.records, f"record {e.record} at {e.span}")
            port = next((p for p in self.ports.get(e.record, ()) if p.name == e.name), None)
            _rule(port is not None and port.type == e.type, f"port {e.name} at {e.span}")
        elif isinstance(e, ir.Member):
            base = self._type(e.base)
            member = base.member(e.name) if isinstance(base, Struct) else None
            _rule(member is not None and member.type == e.type, f"member {e.name} at {e.span}")
        elif isinstance(e, ir.Element):
            self._element(e)
        elif isinstance(e, ir.Slice):
            self._slice(e)
        elif isinstance(e, ir.Apply):
            _rule(tuple(self._type(a) for a in e.args) == e.op.args, f"operands of {e.op.id} at {e.span}")
            _rule(e.op.result == e.type and (not e.fault or bool(e.op.faults)), f"{e.op.id} at {e.span}")
            self.can_fault |= e.fault
        elif isinstance(e, ir.Elementwise):
            for arg, scalar in zip(e.args, e.op.args, strict=True):
                type_ = self._type(arg)
                element = type_.element if isinstance(type_, Array) else type_
                _rule(element == scalar and shape_of(type_) in ((), e.type.shape), f"{e.op.id} at {e.span}")
            self.can_fault |= bool(e.op.faults)
        elif isinstance(e, ir.Adjust):
            _rule(all(self._type(a) == e.type for a in ir.children(e)), f"operands of {e.op.id} at {e.span}")
            _rule(len(e.values) == e.type.count and not e.op.faults, f"{e.op.id} at {e.span}")
        elif isinstance(e, ir.Choose):
            _rule(self._type(e.condition) == BOOL, f"condition at {e.span}")
            _rule(self._type(e.then) == e.type == self._type(e.otherwise), f"branches at {e.span}")
        elif isinstance(e, ir.Let):
            _rule(e.name not in self.names, f"name {e.name} at {e.span}")
            self.names[e.name] = self._type(e.value)
            _rule(self._type(e.body) == e.type, f"shared value at {e.span}")
            del self.names[e.name]
        elif isinstance(e, ir.ArrayValue):
            _rule(len(e.items) == e.type.count, f"elements at {e.span}")
            _rule(all(self._type(i) == e.type.element for i in e.items), f"elements at {e.span}")
        elif isinstance(e, ir.StructValue):
            members = tuple(m.type for m in e.type.members)
            _rule(tuple(self._type(i) for i in e.items) == members, f"members at {e.span}")
        elif isinstance(e, ir.Call):
            self._call(e)
        return e.type

    def _element(self, e: ir.Element) -> None:
        shape = shape_of(self._type(e.base))
        _rule(len(e.indices) == len(e.checked) <= len(shape), f"indices at {e.span}")
        _rule(shape_of(e.type) == shape[len(e.indices) :], f"shape at {e.span}")
        for index, checked in zip(e.indices, e.checked, strict=True):
            type_ = self._type(index)
            _rule(isinstance(type_, Scalar) and type_.is_integer, f"index at {e.span}")
            self.can_fault |= checked

    def _slice(self, e: ir.Slice) -> None:
        shape = shape_of(self._type(e.base))
        _rule(len(e.subscripts) == len(e.checked) == len(shape), f"subscripts at {e.span}")
        kept: list[int] = []
        for subscript, checked, extent in zip(e.subscripts, e.checked, shape, strict=True):
            if isinstance(subscript, ir.Window):
                _rule(0 <= subscript.start < subscript.start + subscript.count <= extent, f"window at {e.span}")
                kept.append(subscript.count)
            else:
                type_ = self._type(subscript)
                _rule(isinstance(type_, Scalar) and type_.is_integer, f"index at {e.span}")
                self.can_fault |= checked
        _rule(bool(kept) and e.type.shape == tuple(kept), f"shape at {e.span}")

    def _call(self, e: ir.Call) -> None:
        function = self.machine.program.functions.get(e.function)
        _rule(function is not None and e.function in self.f.calls, f"call of {e.function} at {e.span}")
        assert function is not None
        _rule(tuple(self._type(a) for a in e.args) == tuple(t for _, t in function.arguments), f"arguments at {e.span}")
        _rule(function.result == e.type and function.faults == e.fault, f"result of {e.function} at {e.span}")
        self.can_fault |= e.fault
