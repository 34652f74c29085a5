# SPDX-License-Identifier: Apache-2.0
"""Makes code of one checked function: signature and statements. A statement that can fault ends with a test of
FAULT."""

from __future__ import annotations

from ..model import code, ir
from ..model.c_names import c_name
from ..model.effects import can_fault
from ..model.events import MOST_VALUES, site_of, sites_of
from ..model.types import BOOL, U32, U64, Array, Scalar, Struct, count_of
from .expressions import ExprEmitter, assigns_all, is_block, zero
from .fault_places import FaultPlaces
from .names import FAULT, HOST, RESULT
from .unrolling import unrolled_for

#: Functions on arrays with at most this many elements are inlined.
_SMALL_ELEMENTS = 16

HOST_TYPE = code.Pointer(code.Named("fcsl_host_t"))
FAULT_TYPE = code.Pointer(U32, writable=True)


class FunctionEmitter(ExprEmitter):
    """Makes one function. `record_types`: of the records of its algorithm."""

    def __init__(
        self, function: ir.Function, machine: str, places: FaultPlaces, record_types: dict[str, str], inlined: bool
    ):
        super().__init__(function, machine, places)
        self.record_types, self.inlined = record_types, inlined
        self._sites = sites_of(function)
        #: Locals that hold what a fault restores from here on.
        self._remembered: set[str] = set()

    # ---- the function ----------------------------------------------------------------------------------------------

    def emit(self) -> code.Function:
        f = self.function
        reads = self._reads()
        for argument in sorted({*f.records, *(c_name(n) for n, _ in f.arguments)} - reads):
            self.out.add(code.Unused(argument))
        whole = self._assigned_whole()
        for name, type_ in f.locals:
            if name == self.returned:
                continue
            self.declare(c_name(name), type_, fill=name not in whole)
            if c_name(name) not in reads:
                self.out.add(code.Unused(c_name(name)))
        self._statements(f.body)
        body = self.out.taken()
        if body and body[-1] == code.Return():
            body = body[:-1]  # a final `return` is redundant
        result = f.result if isinstance(f.result, Scalar) else None
        inline = "always" if self._is_small() else "usual"
        comment = f"{f.span}: {f.source_name}"
        return code.Function(f.name, self._parameters(), result, body, comment, inline, span=f.span)

    def _parameters(self) -> tuple[tuple[str, code.Type], ...]:
        """Pointers are not `restrict`. With two restricted pointers, gcc 12 can confuse them and move a load before a
        store. Measured, `restrict` makes no step faster."""
        f = self.function
        made: list[tuple[str, code.Type]] = []
        for record in f.records:
            made.append((record, code.Pointer(code.Named(self.record_types[record]), record in ("outputs", "state"))))
        if f.takes_host:
            made.append((HOST.text, HOST_TYPE))
        for name, type_ in f.arguments:
            made.append((c_name(name), type_ if isinstance(type_, Scalar) else self.pointer_type(type_)))
        if f.result is not None and not isinstance(f.result, Scalar):
            made.append((RESULT.text, self.pointer_type(f.result, writable=True)))
        if f.faults:
            made.append((FAULT.text, FAULT_TYPE))
        return tuple(made)

    def _is_small(self) -> bool:
        """Whether to inline. Inlined helpers on small arrays keep the elements in registers (measured: the lander's
        step takes 85 ns with this and 149 ns without)."""
        f = self.function
        types = [t for _, t in (*f.arguments, *f.locals)] + ([f.result] if f.result is not None else [])
        return self.inlined and f.result is not None and all(count_of(t) <= _SMALL_ELEMENTS for t in types)

    def _assigned_whole(self) -> set[str]:
        """The locals that an unconditional first statement assigns completely."""
        whole: set[str] = set()
        seen: set[tuple[str, str]] = set()
        for s in self.function.body:
            if isinstance(s, ir.Assign) and isinstance(s.target, ir.Local) and assigns_all(s.value):
                whole |= {s.target.name} if ("", s.target.name) not in seen else set()
            for part in ir.walk((s,)):
                seen.update(*map(ir.variables, ir.expressions(part)))
        return whole

    def _reads(self) -> set[str]:
        """Names of the arguments and locals that the body reads, and of the records that it uses."""
        names: set[str] = set()

        def expression(e: ir.Expr) -> None:
            if isinstance(e, ir.Field):
                names.add(e.record)
            elif isinstance(e, ir.Local):
                names.add(c_name(e.name))
            for child in ir.children(e):
                expression(child)

        def target(place: ir.Place) -> None:
            """Collects from an assignment target: its subscripts are read, its variable is only written."""
            while isinstance(place, ir.Member | ir.Element | ir.Slice):
                for subscript in ir.children(place)[1:]:
                    expression(subscript)
                place = place.base
            if isinstance(place, ir.Field):
                names.add(place.record)

        def body(statements: tuple[ir.Stmt, ...]) -> None:
            for s in statements:
                if isinstance(s, ir.Assign):
                    target(s.target)
                    expression(s.value)
                elif isinstance(s, ir.Effect):
                    if s.target is not None:
                        target(s.target)
                    for arg in s.args:
                        expression(arg)
                elif isinstance(s, ir.Event):
                    for arg in s.args:
                        expression(arg)
                elif isinstance(s, ir.If):
                    expression(s.condition)
                    body(s.then)
                    body(s.otherwise)
                elif isinstance(s, ir.For):
                    body(s.body)
                elif isinstance(s, ir.Return) and s.value is not None:
                    expression(s.value)

        body(self.function.body)
        for undo in self.function.undone:
            expression(undo.before)
        return names

    def _statements(self, statements: tuple[ir.Stmt, ...]) -> None:
        for statement in statements:
            self._statement(statement)

    def _body(self, statements: tuple[ir.Stmt, ...]) -> code.Body:
        with self.out.nested() as body:
            self._statements(statements)
        return tuple(body)

    def _statement(self, s: ir.Stmt) -> None:
        self.out.add(code.At(s.span))
        if isinstance(s, ir.Assign):
            self._assign(s)
            self.release()
        elif isinstance(s, ir.Effect):
            self._effect(s)
            self.release()
        elif isinstance(s, ir.Event):
            self._event(s)
            self.release()
        elif isinstance(s, ir.If):
            self._if(s)
        elif isinstance(s, ir.For):
            self._for(s)
        elif isinstance(s, ir.Return):
            self._return(s)
        else:
            self.out.add(code.Break() if isinstance(s, ir.Break) else code.Continue())

    def _check_fault(self) -> None:
        """Returns from the function if this statement faulted. The machine then restores outputs and state, but for parts
        that the function restores itself."""
        if self._fault:
            self._fault = False
            result = self.function.result
            value = zero(result) if isinstance(result, Scalar) else None
            faulted = code.Binary("!=", code.Deref(FAULT), code.Literal(0, U32))
            with self.out.nested() as restored:
                for undo in reversed(self.function.undone):
                    if undo.before.name in self._remembered:
                        self._assign(ir.Assign(undo.part, undo.before, undo.part.span))
            self.out.add(code.If(faulted, (*restored, code.Return(value))))

    def _if(self, s: ir.If) -> None:
        condition = self.scalar(s.condition)
        if self._fault:
            condition = self.hold(condition, BOOL)
            self._check_fault()
        self.out.add(code.If(condition, self._body(s.then), self._otherwise(s.otherwise)))

    def _otherwise(self, otherwise: tuple[ir.Stmt, ...]) -> code.Body:
        """`elif` is an If alone, unless its condition needs preceding statements."""
        if len(otherwise) == 1 and isinstance(otherwise[0], ir.If):
            inner = otherwise[0]
            with self.out.nested() as before:
                condition = self.scalar(inner.condition)
            if not before and not self._fault:
                chained = code.If(condition, self._body(inner.then), self._otherwise(inner.otherwise))
                return (code.At(inner.span), chained)
            self._fault = False
        return self._body(otherwise)

    def _for(self, s: ir.For) -> None:
        if not s.body:
            return
        start, stop = self.scalar(s.start), self.scalar(s.stop)
        body = self._body(s.body)
        self.out.add(code.For(c_name(s.variable), start, stop, s.step, body, unrolled_for(s)))

    def _return(self, s: ir.Return) -> None:
        if s.value is None:
            self.out.add(code.Return())
        elif not isinstance(s.value.type, Scalar):
            self.into(code.Deref(RESULT), s.value)
            self._check_fault()
            self.out.add(code.Return())
        else:
            value = self.scalar(s.value)
            if self._fault:
                value = self.hold(value, s.value.type)
                self._check_fault()
            self.out.add(code.Return(value))

    def _assign(self, s: ir.Assign) -> None:
        if isinstance(s.value.type, Scalar):
            value = self.scalar(s.value)
            if can_fault(s.target):
                value = self.settled(value, s.value.type)
            self.out.add(code.Set(self.place(s.target), value))
        elif isinstance(s.target, ir.Slice) and not is_block(s.target):
            self.scatter(s.target, self._apart(s.value) if _hazard(s.target, s.value) else self.aggregate(s.value))
        elif _hazard(s.target, s.value) or (can_fault(s.target) and can_fault(s.value)):
            source = self._apart(s.value)
            self.copy(self._destination(s.target), source, s.value.type)
        else:
            self.into(self._destination(s.target), s.value)
        self._check_fault()
        self._remembered |= {u.before.name for u in self.function.undone if u.before == s.target}

    def _effect(self, s: ir.Effect) -> None:
        operands = [*([HOST] if s.is_hardware else []), *map(self.operand, s.args)]
        result = s.function.result
        if s.target is None:
            self.out.add(code.Do(code.Call(s.function.name, tuple(operands))))
        elif isinstance(result, Scalar):
            self.out.add(code.Set(self.place(s.target), code.Call(s.function.name, tuple(operands))))
        elif result is not None:
            given = self.temporary(result)
            operands.append(self.pointer(given, result))
            self.out.add(code.Do(code.Call(s.function.name, tuple(operands))))
            if isinstance(s.target, ir.Slice) and not is_block(s.target):
                self.scatter(s.target, given)
            else:
                self.copy(self._destination(s.target), given, result)
        self._check_fault()

    def _event(self, s: ir.Event) -> None:
        values: list[code.Expr] = []
        for arg in s.args:
            assert isinstance(arg.type, Scalar)
            values.append(code.Call(f"fcsl_event_{arg.type.name.lower()}", (self.scalar(arg),)))
        values += [code.Literal(0, U64)] * (MOST_VALUES - len(values))
        number = code.Literal(self._sites.index(site_of(s)), U32)
        self.out.add(code.Do(code.Call("fcsl_event", (HOST, number, *values))))

    def _apart(self, value: ir.Expr) -> code.Name:
        """Computes a value into separate storage."""
        assert isinstance(value.type, Array | Struct)
        temporary = self.temporary(value.type)
        self.into(temporary, value)
        return temporary

    def _destination(self, target: ir.Place) -> code.Place:
        """A target with subscripts is evaluated once."""
        place = self.place(target)
        if isinstance(target.type, Struct):
            return self.hold_pointer(place, target.type, writable=True) if _is_indexed(place) else place
        return self.hold_pointer(place, target.type, writable=True) if isinstance(place, code.Part) else place


def _is_indexed(place: code.Place) -> bool:
    """Whether an index is in the path of a place."""
    while isinstance(place, code.Member):
        place = place.base
    return isinstance(place, code.Element | code.Part)


def _hazard(target: ir.Place, value: ir.Expr) -> bool:
    """True if writing parts of the target could change a value that is still read."""
    root = ir.variable(target)
    whole = not isinstance(target, ir.Element | ir.Slice)

    def reads(e: ir.Expr, same_index: bool) -> bool:
        if isinstance(e, ir.Place) and ir.variable(e) == root:
            return not (same_index and whole and not isinstance(e, ir.Element | ir.Slice))
        if same_index and isinstance(e, ir.Call):
            return False  # it is computed into a temporary first
        aligned = same_index and isinstance(e, ir.Elementwise)
        return any(reads(c, aligned and isinstance(c.type, Array)) for c in ir.children(e))

    if isinstance(value, ir.Elementwise):
        return any(reads(a, isinstance(a.type, Array)) for a in value.args)
    if isinstance(value, ir.Adjust) and value.constant is None:
        return _hazard(target, value.base)
    if isinstance(value, ir.Choose):
        return _hazard(target, value.then) or _hazard(target, value.otherwise)
    if isinstance(value, ir.Place):
        return ir.variable(value) == root and value != target
    if isinstance(value, ir.Call):
        # Other arguments are computed into temporaries first; scalars are passed by value.
        given = [a for a in value.args if isinstance(a, ir.Place) and not isinstance(a.type, Scalar)]
        return any(ir.variable(a) == root for a in given)
    return any(reads(c, False) for c in ir.children(value))
