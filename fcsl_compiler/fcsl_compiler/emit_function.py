# SPDX-License-Identifier: Apache-2.0
"""C for one checked function.

Scalars become C expressions. Arrays have storage: an array-valued expression is computed into a destination, through a
temporary where the destination is also an operand. What an expression needs computed first goes on lines before it, inside
the branch that needs it. A faulting operation sets *fault_ and yields a harmless value; the statement ends with the test.
"""

from __future__ import annotations

from . import ir
from .c_names import c_literal, c_name
from .c_writer import CWriter, Lines
from .ops import Op
from .types import HEALTH, HEALTH_NAMES, Array, Scalar, Type, count_of, scalar_of, shape_of

#: Constant arrays longer than this are copied from a table instead of being stored element by element.
_INLINE_ELEMENTS = 4
#: Functions on arrays of at most this many elements are inlined.
_SMALL_ELEMENTS = 16

INDEX_HELPER = """static inline int64_t fcsl_index(int64_t index, int64_t size, int32_t *fault)
{
    if (index < 0 || index >= size) {
        *fault = 1;
        return 0;
    }
    return index;
}
"""


class FunctionEmitter:
    """Writes one function; `helpers` and `constants` collect what it uses."""

    def __init__(self, writer: CWriter, function: ir.Function, machine: str, record_types: dict[str, str]):
        self.w, self.function, self.machine, self.record_types = writer, function, machine, record_types
        self.helpers: dict[str, str] = {}
        self._temporaries = 0
        self._fault = False  # the statement being written can fault

    # ---- the function ----------------------------------------------------------------------------------------------

    def signature(self) -> str:
        f = self.function
        parameters: list[str] = []
        for argument, record in f.records:
            const = "" if record in ("outputs", "state") else "const "
            parameters.append(f"{const}{self.record_types[record]} *restrict {c_name(argument)}")
        for name, type_ in f.arguments:
            if isinstance(type_, Array):
                parameters.append(f"const {type_.element.c} *restrict {c_name(name)}")
            else:
                parameters.append(f"{type_.c} {c_name(name)}")
        result = "void"
        if isinstance(f.result, Array):
            parameters.append(f"{f.result.element.c} *restrict result_")
        elif f.result is not None:
            result = f.result.c
        if f.faults:
            parameters.append("int32_t *restrict fault_")
        inline = "static inline __attribute__((always_inline))" if self._is_small() else "static"
        return f"{inline} {result} {f.name}({', '.join(parameters) or 'void'})"

    def _is_small(self) -> bool:
        """Helpers on small arrays go into their callers, where the C compiler keeps the elements in registers (measured:
        the lander's step takes 85 ns with this and 149 without).
        """
        f = self.function
        types = [t for _, t in (*f.arguments, *f.locals)] + ([f.result] if f.result is not None else [])
        return f.result is not None and all(count_of(t) <= _SMALL_ELEMENTS for t in types)

    def emit(self) -> None:
        f, w = self.function, self.w
        w.origin = f.span
        w.line(f"/* {f.span}: {f.source_name} */")
        w.line(self.signature())
        w.open_body()
        reads = self._reads()
        for argument in sorted({c_name(n) for n, _ in (*f.records, *f.arguments)} - reads):
            w.line(f"(void){argument};")
        for name, type_ in f.locals:
            if isinstance(type_, Array):
                w.line(f"{type_.element.c} {c_name(name)}[{type_.count}] = {{0}};")
            else:
                w.line(f"{type_.c} {c_name(name)} = {_zero(type_)};")
            if c_name(name) not in reads:
                w.line(f"(void){c_name(name)};")
        self._statements(f.body)
        w.close()
        w.origin = None
        w.line()

    def _reads(self) -> set[str]:
        """C names of the arguments and locals that the body reads, and of the records that it mentions."""
        names: set[str] = set()

        def expression(e: ir.Expr) -> None:
            if isinstance(e, ir.Field):
                names.add(c_name(e.argument))
            elif isinstance(e, ir.Local):
                names.add(c_name(e.name))
            elif isinstance(e, ir.Element):
                expression(e.base)
            for child in _children(e):
                expression(child)

        def body(statements: tuple[ir.Stmt, ...]) -> None:
            for s in statements:
                if isinstance(s, ir.Assign):
                    root = s.target.base if isinstance(s.target, ir.Element) else s.target
                    if isinstance(root, ir.Field):
                        names.add(c_name(root.argument))
                    for index in _children(s.target):
                        expression(index)
                    expression(s.value)
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
        elif isinstance(s, ir.If):
            self._if(s)
        elif isinstance(s, ir.For):
            w.at(s.span)
            if not s.body:
                return
            i, relation = c_name(s.variable), "<" if s.step > 0 else ">"
            start, stop = _bare(self.scalar(s.start)), _bare(self.scalar(s.stop))
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
        """Leaves the function when this statement faulted; the machine then restores outputs and state."""
        if self._fault:
            self._fault = False
            value = f" {_zero(self.function.result)}" if isinstance(self.function.result, Scalar) else ""
            with self.w.braces("if (*fault_ != 0)"):
                self.w.line(f"return{value};")

    def _if(self, s: ir.If) -> None:
        w = self.w
        w.at(s.span)
        condition = self.scalar(s.condition)
        if self._fault:
            condition = self._hold(condition, "bool")
            self._check_fault()
        w.open(f"if ({_bare(condition)})")
        self._statements(s.then)
        if s.otherwise:
            w.reopen("else")
            self._statements(s.otherwise)
        w.close()

    def _return(self, s: ir.Return) -> None:
        w = self.w
        if s.value is None:
            w.line("return;")
        elif isinstance(s.value.type, Array):
            self.into("result_", s.value)
            self._check_fault()
            w.line("return;")
        else:
            value = self.scalar(s.value)
            if self._fault:
                assert isinstance(s.value.type, Scalar)
                value = self._hold(value, s.value.type.c)
                self._check_fault()
            w.line(f"return {_bare(value)};")

    def _assign(self, s: ir.Assign) -> None:
        if isinstance(s.value.type, Array):
            destination = self.array(s.target)
            if destination.startswith("&"):
                destination = self._hold(destination, f"{s.value.type.element.c} *")
            if _hazard(s.target, s.value):
                temporary = self._temporary(s.value.type)
                self.into(temporary, s.value)
                self._copy(destination, temporary, s.value.type)
            else:
                self.into(destination, s.value)
        else:
            value = self.scalar(s.value)
            self.w.line(f"{self.scalar(s.target)} = {_bare(value)};")
        self._check_fault()

    def _hold(self, text: str, c_type: str) -> str:
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        head = f"{c_type}const" if c_type.endswith("*") else f"const {c_type}"
        self.w.line(f"{head} {name} = {_bare(text)};")
        return name

    def _temporary(self, type_: Array) -> str:
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        self.w.line(f"{type_.element.c} {name}[{type_.count}] = {{0}};")
        return name

    # ---- scalars ---------------------------------------------------------------------------------------------------

    def scalar(self, e: ir.Expr) -> str:
        """C expression of a scalar; array operands are computed on lines before."""
        if isinstance(e, ir.Const):
            if isinstance(e.value, str):
                return f"{self.machine}_tr_{e.value}" if e.value else "0"
            assert isinstance(e.type, Scalar)
            return f"FCSL_{HEALTH_NAMES[int(e.value)].upper()}" if e.type is HEALTH else c_literal(e.value, e.type)
        if isinstance(e, ir.Local | ir.RangeVar):
            return c_name(e.name)
        if isinstance(e, ir.Field):
            return f"{c_name(e.argument)}->{c_name(e.name)}"
        if isinstance(e, ir.Element):
            return f"{self._base(e.base)}[{self._offset(e)}]"
        if isinstance(e, ir.Apply):
            return self._operation(e.op, [self.scalar(a) for a in e.args], e.fault)
        if isinstance(e, ir.Choose):
            return self._choose(e)
        if isinstance(e, ir.Let):
            self.w.line(f"const {scalar_of(e.value.type).c} {c_name(e.name)} = {_bare(self.scalar(e.value))};")
            return self.scalar(e.body)
        if isinstance(e, ir.Call):
            return self._call(e, [])
        raise AssertionError(f"not a scalar: {e}")

    def _operation(self, op: Op, operands: list[str], fault: bool) -> str:
        c, helper = (op.c, op.helper) if fault or not op.faults else (op.proven, op.proven_helper)
        if helper:
            self.helpers[helper.split("(", 1)[0].rsplit(" ", 1)[1]] = helper
        self._fault = self._fault or fault
        if c.startswith("("):
            operands = [f"({o})" if o.startswith("-") else o for o in operands]
        else:
            operands = [_bare(o) for o in operands]
        return c.format(*operands, fault="fault_")

    def _choose(self, e: ir.Choose) -> str:
        condition = self.scalar(e.condition)
        then, then_lines = self._captured(e.then)
        otherwise, else_lines = self._captured(e.otherwise)
        if not then_lines[0] and not else_lines[0]:
            if isinstance(e.otherwise, ir.Const) and e.otherwise.value is False:
                return f"({condition} && {then})"
            if isinstance(e.then, ir.Const) and e.then.value is True:
                return f"({condition} || {otherwise})"
            return f"({condition} ? {then} : {otherwise})"
        assert isinstance(e.type, Scalar)
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        self.w.line(f"{e.type.c} {name} = {_zero(e.type)};")
        self.w.open(f"if ({_bare(condition)})")
        self.w.paste(then_lines)
        self.w.line(f"{name} = {_bare(then)};")
        self.w.reopen("else")
        self.w.paste(else_lines)
        self.w.line(f"{name} = {_bare(otherwise)};")
        self.w.close()
        return name

    def _captured(self, e: ir.Expr) -> tuple[str, Lines]:
        mark = self.w.mark()
        with self.w.indented():
            text = self.scalar(e)
        return text, self.w.cut(mark)

    def _call(self, e: ir.Call, out: list[str]) -> str:
        operands: list[str] = []
        for arg in e.args:
            operands.append(self.array(arg) if isinstance(arg.type, Array) else _bare(self.scalar(arg)))
        if e.fault:
            self._fault = True
        fault = ["fault_"] if e.fault else []
        return f"{e.function}({', '.join([*operands, *out, *fault])})"

    def _base(self, base: ir.Local | ir.Field | ir.ModuleConst) -> str:
        if isinstance(base, ir.ModuleConst):
            return constant_name(self.function, base.name)
        return self.scalar(base) if isinstance(base, ir.Field) else c_name(base.name)

    def _offset(self, e: ir.Element) -> str:
        """Row-major position of the first selected scalar."""
        shape = shape_of(e.base.type)
        constant, terms = 0, []
        for position, (index, checked) in enumerate(zip(e.indices, e.checked, strict=True)):
            stride = 1
            for extent in shape[position + 1 :]:
                stride *= extent
            if isinstance(index, ir.Const):
                assert isinstance(index.value, int)
                constant += index.value * stride
                continue
            text = self.scalar(index)
            if checked:
                self._fault = True
                text = f"fcsl_index({self._wide(index, text)}, {shape[position]}, fault_)"
                self.helpers["fcsl_index"] = INDEX_HELPER
            terms.append(text if stride == 1 else f"{text} * {stride}")
        if constant or not terms:
            terms.append(str(constant))
        return " + ".join(terms)

    def _wide(self, index: ir.Expr, text: str) -> str:
        if isinstance(index.type, Scalar) and index.type.name == "u64":
            # Beyond INT64_MAX an index is out of range in any case; -1 says so.
            return f"({text} > (uint64_t)INT64_MAX ? -1 : (int64_t){text})"
        return _bare(text)

    # ---- arrays ----------------------------------------------------------------------------------------------------

    def array(self, e: ir.Expr) -> str:
        """C pointer to the elements of an array: its own storage, or a temporary computed on lines before."""
        if isinstance(e, ir.Local | ir.Field | ir.ModuleConst):
            return self._base(e)
        if isinstance(e, ir.Element):
            return f"&{self._base(e.base)}[{self._offset(e)}]"
        assert isinstance(e.type, Array)
        temporary = self._temporary(e.type)
        self.into(temporary, e)
        return temporary

    def into(self, destination: str, e: ir.Expr) -> None:
        """Computes an array into storage that is no operand of it (element by element for whole-array operands)."""
        assert isinstance(e.type, Array)
        if isinstance(e, ir.Elementwise):
            self._elementwise(destination, e)
        elif isinstance(e, ir.ArrayValue):
            self._array_value(destination, e)
        elif isinstance(e, ir.Call):
            self.w.line(f"{self._call(e, [destination])};")
        elif isinstance(e, ir.Choose):
            self.w.open(f"if ({_bare(self.scalar(e.condition))})")
            self.into(destination, e.then)
            self.w.reopen("else")
            self.into(destination, e.otherwise)
            self.w.close()
        else:
            self._copy(destination, self.array(e), e.type)

    def _copy(self, destination: str, source: str, type_: Array) -> None:
        if destination != source:
            self.w.line(f"memcpy({destination}, {source}, {type_.count} * sizeof({type_.element.c}));")

    def _array_value(self, destination: str, e: ir.ArrayValue) -> None:
        if len(e.items) > _INLINE_ELEMENTS and all(isinstance(i, ir.Const) for i in e.items):
            self._temporaries += 1
            name = f"k{self._temporaries}_"
            values = ", ".join(self.scalar(i) for i in e.items)
            self.w.line(f"static const {e.type.element.c} {name}[{e.type.count}] = {{{values}}};")
            self._copy(destination, name, e.type)
            return
        for position, item in enumerate(e.items):
            self.w.line(f"{destination}[{position}] = {_bare(self.scalar(item))};")

    def _elementwise(self, destination: str, e: ir.Elementwise) -> None:
        text = self._element(e)
        with self.w.braces(f"for (int32_t i_ = 0; i_ < {e.type.count}; ++i_)"):
            self.w.line(f"{destination}[i_] = {_bare(text)};")

    def _element(self, e: ir.Expr) -> str:
        """C expression of element i_; scalars and inner arrays are computed on lines before."""
        if isinstance(e, ir.Elementwise):
            return self._operation(e.op, [self._element(a) for a in e.args], bool(e.op.faults))
        if isinstance(e.type, Array):
            name = self.array(e)
            return f"({name})[i_]" if name.startswith("&") else f"{name}[i_]"
        text = self.scalar(e)
        simple = isinstance(e, ir.Const | ir.Local | ir.RangeVar | ir.Field)
        return text if simple else self._hold(text, scalar_of(e.type).c)


def constant_name(function: ir.Function, name: str) -> str:
    """C name of a module constant array: one per algorithm."""
    return f"{function.name.removesuffix('__' + function.source_name)}_k_{name}_"


def _zero(type_: Type | None) -> str:
    assert isinstance(type_, Scalar)
    return "0.0" if type_.name == "f64" else "0.0f" if type_.name == "f32" else "false" if type_.name == "bool" else "0"


def _bare(text: str) -> str:
    """Without the parentheses that enclose the whole expression."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for position, char in enumerate(text):
        depth += (char == "(") - (char == ")")
        if depth == 0 and position < len(text) - 1:
            return text
    return text[1:-1]


def _root(e: ir.Expr) -> tuple[str, str] | None:
    if isinstance(e, ir.Element):
        return _root(e.base)
    if isinstance(e, ir.Local):
        return ("", e.name)
    if isinstance(e, ir.Field):
        return (e.record, e.name)
    return None


def _children(e: ir.Expr) -> tuple[ir.Expr, ...]:
    if isinstance(e, ir.Apply | ir.Elementwise | ir.Call):
        return e.args
    if isinstance(e, ir.Choose):
        return (e.condition, e.then, e.otherwise)
    if isinstance(e, ir.Let):
        return (e.value, e.body)
    if isinstance(e, ir.ArrayValue):
        return e.items
    if isinstance(e, ir.Element):
        return e.indices
    return ()


def _hazard(target: ir.Place, value: ir.Expr) -> bool:
    """True when writing the target element by element could change what the value still reads."""
    root = _root(target)
    whole = not isinstance(target, ir.Element)

    def reads(e: ir.Expr, same_index: bool) -> bool:
        if _root(e) == root:
            if not (same_index and whole and not isinstance(e, ir.Element)):
                return True
            return False
        aligned = same_index and isinstance(e, ir.Elementwise)
        return any(reads(c, aligned and isinstance(c.type, Array)) for c in _children(e))

    if isinstance(value, ir.Elementwise):
        return any(reads(a, isinstance(a.type, Array)) for a in value.args)
    if isinstance(value, ir.Choose):
        return _hazard(target, value.then) or _hazard(target, value.otherwise)
    if isinstance(value, ir.Local | ir.Field | ir.Element):
        return _root(value) == root and value != target
    return any(reads(c, False) for c in _children(value))
