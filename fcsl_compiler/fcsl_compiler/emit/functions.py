# SPDX-License-Identifier: Apache-2.0
"""Generates C for one checked function: signature and statements. A statement that can fault ends with a test of
*fault_."""

from __future__ import annotations

from ..model import ir
from ..model.c_names import c_name
from ..model.effects import can_fault
from ..model.types import Array, Scalar, Struct, count_of
from .c_writer import CWriter
from .expressions import ExprEmitter, assigns_all, bare, is_block, zero
from .fault_places import FaultPlaces
from .unrolling import unroll_for

#: Functions on arrays with at most this many elements are inlined.
_SMALL_ELEMENTS = 16


class FunctionEmitter(ExprEmitter):
    """Generates one function."""

    def __init__(
        self,
        writer: CWriter,
        function: ir.Function,
        machine: str,
        places: FaultPlaces,
        record_types: dict[str, str],
        inlined: bool,
    ):
        super().__init__(writer, function, machine, places)
        self.record_types, self.inlined = record_types, inlined

    # ---- the function ----------------------------------------------------------------------------------------------

    def signature(self) -> str:
        """The signature, without `restrict`. With two restricted pointers, gcc 12 can confuse them and move a load
        before a store. Measured, `restrict` makes no step faster."""
        f = self.function
        parameters: list[str] = []
        for record in f.records:
            const = "" if record in ("outputs", "state") else "const "
            parameters.append(f"{const}{self.record_types[record]} *{record}")
        if f.uses_hardware:
            parameters.append("const fcsl_host_t *host_")
        for name, type_ in f.arguments:
            if isinstance(type_, Scalar):
                parameters.append(f"{type_.c} {c_name(name)}")
            else:
                parameters.append(f"const {self.c_type(type_)} *{c_name(name)}")
        result = "void"
        if isinstance(f.result, Scalar):
            result = f.result.c
        elif f.result is not None:
            parameters.append(f"{self.c_type(f.result)} *result_")
        if f.faults:
            parameters.append("uint32_t *fault_")
        inline = "static inline __attribute__((always_inline))" if self._is_small() else "static"
        return f"{inline} {result} {f.name}({', '.join(parameters) or 'void'})"

    def _is_small(self) -> bool:
        """Whether to inline. Inlined helpers on small arrays keep the elements in registers (measured: the lander's
        step takes 85 ns with this and 149 ns without)."""
        f = self.function
        types = [t for _, t in (*f.arguments, *f.locals)] + ([f.result] if f.result is not None else [])
        return self.inlined and f.result is not None and all(count_of(t) <= _SMALL_ELEMENTS for t in types)

    def emit(self) -> None:
        f, w = self.function, self.w
        w.origin = f.span
        w.line(f"/* {f.span}: {f.source_name} */")
        w.line(self.signature())
        w.open_body()
        reads = self._reads()
        for argument in sorted({*f.records, *(c_name(n) for n, _ in f.arguments)} - reads):
            w.line(f"(void){argument};")
        whole = self._assigned_whole()
        for name, type_ in f.locals:
            if name == self.returned:
                continue
            self.declare(c_name(name), type_, fill=name not in whole)
            if c_name(name) not in reads:
                w.line(f"(void){c_name(name)};")
        self._statements(f.body)
        if w.lines[-1] == "    return;":
            w.cut(w.mark() - 1)  # a final `return` is redundant
        w.close()
        w.origin = None
        w.line()

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
        """C names of the arguments and locals that the body reads, and of the records that it uses."""
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
                elif isinstance(s, ir.If):
                    expression(s.condition)
                    body(s.then)
                    body(s.otherwise)
                elif isinstance(s, ir.For):
                    body(s.body)
                elif isinstance(s, ir.Return) and s.value is not None:
                    expression(s.value)

        body(self.function.body)
        return names

    def _statements(self, statements: tuple[ir.Stmt, ...]) -> None:
        for statement in statements:
            self._statement(statement)

    def _statement(self, s: ir.Stmt) -> None:
        w = self.w
        if isinstance(s, ir.Assign):
            w.at(s.span)
            self._assign(s)
            self.release()
        elif isinstance(s, ir.Effect):
            w.at(s.span)
            self._effect(s)
            self.release()
        elif isinstance(s, ir.If):
            self._if(s)
        elif isinstance(s, ir.For):
            w.at(s.span)
            if not s.body:
                return
            i, relation = c_name(s.variable), "<" if s.step > 0 else ">"
            start, stop = bare(self.scalar(s.start)), bare(self.scalar(s.stop))
            unroll_for(w, s)
            w.open(f"for (int64_t {i} = {start}; {i} {relation} {stop}; {i} += {s.step})")
            self._statements(s.body)
            w.close()
        elif isinstance(s, ir.Return):
            w.at(s.span)
            self._return(s)
        else:
            w.at(s.span)
            w.line("break;" if isinstance(s, ir.Break) else "continue;")

    def _check_fault(self) -> None:
        """Returns from the function if this statement faulted. The machine then restores outputs and state."""
        if self._fault:
            self._fault = False
            value = f" {zero(self.function.result)}" if isinstance(self.function.result, Scalar) else ""
            with self.w.braces("if (*fault_ != 0u)"):
                self.w.line(f"return{value};")

    def _if(self, s: ir.If) -> None:
        w = self.w
        w.at(s.span)
        condition = self.scalar(s.condition)
        if self._fault:
            condition = self.hold(condition, "bool")
            self._check_fault()
        w.open(f"if ({bare(condition)})")
        self._statements(s.then)
        self._else(s.otherwise)
        w.close()

    def _else(self, otherwise: tuple[ir.Stmt, ...]) -> None:
        """`elif` becomes `else if` unless its condition needs preceding lines."""
        w = self.w
        if len(otherwise) == 1 and isinstance(otherwise[0], ir.If):
            inner, mark = otherwise[0], w.mark()
            condition = self.scalar(inner.condition)
            lines, _ = w.cut(mark)
            if not lines and not self._fault:
                w.origin = inner.span
                w.reopen(f"else if ({bare(condition)})")
                w.at(inner.span)
                self._statements(inner.then)
                self._else(inner.otherwise)
                return
            self._fault = False
        if otherwise:
            w.reopen("else")
            self._statements(otherwise)

    def _return(self, s: ir.Return) -> None:
        w = self.w
        if s.value is None:
            w.line("return;")
        elif not isinstance(s.value.type, Scalar):
            self.into("(*result_)" if isinstance(s.value.type, Struct) else "result_", s.value)
            self._check_fault()
            w.line("return;")
        else:
            value = self.scalar(s.value)
            if self._fault:
                value = self.hold(value, s.value.type.c)
                self._check_fault()
            w.line(f"return {bare(value)};")

    def _assign(self, s: ir.Assign) -> None:
        if isinstance(s.value.type, Scalar):
            value = self.scalar(s.value)
            if can_fault(s.target):
                value = self.settled(value, s.value.type)
            self.w.line(f"{self.scalar(s.target)} = {bare(value)};")
        elif isinstance(s.target, ir.Slice) and not is_block(s.target):
            self.scatter(s.target, self._apart(s.value) if _hazard(s.target, s.value) else self.aggregate(s.value))
        elif _hazard(s.target, s.value) or (can_fault(s.target) and can_fault(s.value)):
            source = self._apart(s.value)
            self.copy(self._destination(s.target), source, s.value.type)
        else:
            self.into(self._destination(s.target), s.value)
        self._check_fault()

    def _effect(self, s: ir.Effect) -> None:
        operands = [*(["host_"] if s.is_hardware else []), *map(self.operand, s.args)]
        result = s.function.result
        if s.target is None:
            self.w.line(f"{s.function.name}({', '.join(operands)});")
        elif isinstance(result, Scalar):
            self.w.line(f"{self.scalar(s.target)} = {s.function.name}({', '.join(operands)});")
        elif result is not None:
            given = self.temporary(result)
            operands.append(self.pointer(given, result))
            self.w.line(f"{s.function.name}({', '.join(operands)});")
            if isinstance(s.target, ir.Slice) and not is_block(s.target):
                self.scatter(s.target, given)
            else:
                self.copy(self._destination(s.target), given, result)
        self._check_fault()

    def _apart(self, value: ir.Expr) -> str:
        """Computes a value into separate storage."""
        assert isinstance(value.type, Array | Struct)
        temporary = self.temporary(value.type)
        self.into(temporary, value)
        return temporary

    def _destination(self, target: ir.Place) -> str:
        """C expression of a target. A target with subscripts is evaluated once."""
        text = self.place(target)
        if isinstance(target.type, Struct):
            return f"(*{self.hold('&' + text, self.c_type(target.type) + ' *')})" if "[" in text else text
        return self.hold(text, f"{self.c_type(target.type)} *") if text.startswith("&") else text


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
