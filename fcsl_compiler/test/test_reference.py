# SPDX-License-Identifier: Apache-2.0
"""The reference itself: operations of its values, and their errors, without compiled code."""

import math
import random
import re
import struct
from functools import reduce
from typing import Any

import pytest

from fcsl_compiler.reference.algorithm import Algorithm, SourceModule, declare_structs
from fcsl_compiler.reference.arrays import Array, array_type
from fcsl_compiler.reference.library import _WITH_LOOPS, library
from fcsl_compiler.reference.structs import Struct
from fcsl_compiler.reference.types import SCALARS
from fcsl_compiler.reference.unroll import TooLarge, Writer
from fcsl_compiler.reference.values import F32, I32, I64, U32, U64, Fault, IllTyped, as_f32


def law_of(text: str, structs: dict[str, dict[str, str]] | None = None) -> Algorithm:
    return Algorithm(SourceModule(text, "law.py", declare_structs(structs or {})), "Law")


def run(text: str, structs: dict[str, dict[str, str]] | None = None, **inputs: Any) -> Struct:
    """`self` after one execute on zeroed ports with these inputs."""
    algorithm = law_of(text, structs)
    self = algorithm.type.zero()
    for name, value in inputs.items():
        setattr(self, name, value)
    algorithm.run("execute", self)
    return self


def law(outputs: str, *body: str, inputs: str = "x: f64") -> str:
    """A class with these outputs, `name: type; …`."""
    ports = [dict(one.split(": ") for one in text.split("; ")) for text in (inputs, outputs)]
    lines = ["class Law:", f"    inputs = {ports[0]}", f"    outputs = {ports[1]}", "    def execute(self):"]
    return "\n".join([*lines, *(f"        {line}" for line in body)]) + "\n"


# ---- numbers ----------------------------------------------------------------------------------------------------------


def test_numbers_print_as_numbers() -> None:
    assert repr([I32(-3), U64(7), F32(0.5)]) == "[-3, 7, 0.5]" and f"{I64(5):3d}|{F32(1.25):.1f}" == "  5|1.2"


@pytest.mark.parametrize(
    ("value", "type_"), [(I32(1) + 2, I32), (2 * U32(3), U32), (1 - F32(0.5), F32), (-I64(1), I64)]
)
def test_literals_adopt(value: Any, type_: type) -> None:
    assert type(value) is type_


def test_integers_fault_or_wrap() -> None:
    assert U32(0) - 1 == 2**32 - 1 and U64(2**63) * 2 == 0 and -U32(1) == 2**32 - 1 and ~U32(0) == 2**32 - 1
    for faulting in (
        lambda: I32(2**31 - 1) + 1,
        lambda: -I64(-(2**63)),
        lambda: abs(I32(-(2**31))),
        lambda: I32(-(2**31)) // -1,
        lambda: U32(1) // U32(0),
        lambda: I64(1) % 0,
        lambda: U32(1) << 32,
        lambda: I32(1) >> I32(-1),
    ):
        with pytest.raises(Fault):
            faulting()


@pytest.mark.parametrize(
    "mixed",
    [
        lambda: I32(1) + I64(1),
        lambda: U32(1) * U64(1),
        lambda: I32(1) - 1.0,
        lambda: F32(1.0) + I32(1),
        lambda: I32(1) * F32(1.0),
        lambda: I32(1) / 2,
        lambda: I32(1) << 1,
        lambda: I64(3) & I32(1),
        lambda: I32(1) + True,
    ],
)
def test_types_never_mix(mixed: Any) -> None:
    with pytest.raises(IllTyped):
        mixed()


def test_f32_is_rounded_after_every_operation() -> None:
    x = F32(16777216.0)
    assert x + 1.0 == x and (x + 1.0) + 1.0 == x and x + 2.0 == 16777218.0
    assert F32(3.0e38) * 10 == math.inf and F32(1.0) / 0 == math.inf and math.isnan(F32(0.0) / 0)
    assert (
        not F32(0.0) < 1e-60 and 0.1 == run(law("y: f32", "self.y = 0.1")).y
    )  # the literal is rounded before it is compared


# ---- the rewrite ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("self.x / 0", math.inf),
        ("-self.x / 0", -math.inf),
        ("7.5 // self.x % 2", 1.0),
        ("self.x ** 2 ** 2", 39.0625),
        ("self.x if self.x < 1 else 3", 3.0),
        ("f64(1 if self.x < 1 else 3) / 2", 1.5),
        ("min(self.x, 3, 1)", 1.0),
        ("-(0 if self.x > 0 else 1.5)", -0.0),
    ],
)
def test_expressions(expression: str, expected: float) -> None:
    found = run(law("y: f64", f"self.y = {expression}"), x=2.5).y
    assert type(found) is float and found == expected and math.copysign(1, found) == math.copysign(1, expected)


def test_a_local_has_one_type() -> None:
    text = law(
        "y: f32; n: i32",
        "t = 0.1 if self.x > 0 else self.y",
        "t = t * t",
        "self.y = t",
        "n = self.n",
        "n = 3",
        "self.n = n",
    )
    outputs = run(text, x=1.0)
    assert outputs.y == as_f32(0.1) * as_f32(0.1) and type(outputs.n) is I32


@pytest.mark.parametrize("targets", ["a, a, b", "a, b, a", "b, a, a", "a, a, a"])
def test_the_last_value_of_a_name_that_is_bound_twice_counts(targets: str) -> None:
    """CPython 3.11.2 keeps an earlier one, where the values are written beside each other."""
    last = {name: float(value) for value, name in enumerate(targets.split(", "))}
    found = run(law("y: f64; z: f64", "b = 9.0", f"{targets} = 0.0, 1.0, 2.0", "self.y = a", "self.z = b"))
    assert (found.y, found.z) == (last["a"], last.get("b", 9.0))


def test_values_are_copied() -> None:
    text = law(
        "a: f64[2]; b: f64[2]; m: f64[2][2]",
        "t = self.a",
        "t[0] = 1.0",
        "self.b = t",
        "t[1] = 2.0",
        "self.m[0] = t",
        "self.m[1] = self.m[0]",
        "self.m[0][1] = 9.0",
        "self.a, self.b = self.b, self.a",
    )
    outputs = run(text)
    assert repr(outputs.a) == "[1.0, 0.0]" and repr(outputs.b) == "[0.0, 0.0]"
    assert repr(outputs.m) == "[[1.0, 9.0], [1.0, 2.0]]"


def test_negative_indices_count_from_the_end_only_as_constants() -> None:
    text = law("y: f64[3]", "self.y[-1] = 1.0", "self.y[i64(self.x)] = 2.0")
    assert repr(run(text, x=1.0).y) == "[0.0, 2.0, 1.0]"
    with pytest.raises(Fault):
        run(text, x=-1.0)


def test_products_of_loop_variables_fault_like_i64() -> None:
    lines = ["for i in range(2147483646, 2147483647):", "    self.y = f64(i * i * {})"]
    assert run(law("y: f64", lines[0], lines[1].format(2))).y == float(2147483646**2 * 2)
    with pytest.raises(Fault):
        run(law("y: f64", lines[0], lines[1].format("i")))


def test_structs_are_built_of_every_field_once() -> None:
    structs = {"Outer": {"inner": "Inner[2]", "copy": "f64"}, "Inner": {"v": "f64[2]", "n": "i32"}}
    text = law(
        "o: Outer",
        "o = Outer(copy=1, inner=[Inner([1.0, 2], 3), Inner(n=4, v=[5.0, self.x])])",
        "self.o = o",
        "o.copy = 7.0",
    )
    outputs = run(text, structs, x=6.0)
    assert repr(outputs.o) == "Outer(inner=[Inner(v=[1.0, 2.0], n=3), Inner(v=[5.0, 6.0], n=4)], copy=1.0)"
    for wrong in ("Inner([1.0, 2.0])", "Inner([1.0], 2)", "Inner([1.0, 2.0], 3, n=3)", "Inner([1.0, 2.0], 0.5)"):
        with pytest.raises(IllTyped):
            run(law("o: Inner", f"self.o = {wrong}"), structs)


def test_what_is_stored_has_the_type_of_its_place() -> None:
    lines = [
        "self.n = self.x",
        "self.f = self.n",
        "self.b = self.n",
        "self.v = [1.0]",
        "self.n = i64(1)",
        "self.v[0] = True",
    ]
    lines += ["self.h = self.n", "self.n = self.h", "self.f = self.v"]
    for line in lines:
        with pytest.raises(IllTyped):
            run(law("n: i32; f: f64; b: bool; v: f64[2]; h: Health", line))


def test_lines_and_names_stay() -> None:
    """In a debugger: the lines of the file, locals under their names, and no other names."""
    text = law("y: f64", "a = self.x / 2.0", "", "b = [a, 1 / a]", "self.y = b[0]", "self.y += a")
    self = run(text, x=8.0)
    assert tuple(vars(self)) == ("x", "y", "health") and repr(self) == "Law(x=8.0, y=8.0, health='nominal')"
    code = type(self).execute.__code__  # type: ignore[attr-defined]
    assert code.co_filename == "law.py" and code.co_name == "execute" and code.co_varnames == ("self", "a", "b")
    first = text.splitlines().index("        a = self.x / 2.0") + 1
    lines = {line for _, _, line in code.co_lines() if line}
    assert lines == {first - 1, first, first + 2, first + 3, first + 4}


def test_self_has_the_ports_and_nothing_else() -> None:
    for line in ("self.z = 1.0", "self.inputs = 1.0", "t = self.z"):
        with pytest.raises((KeyError, AttributeError)):
            run(law("y: f64", line))


def test_indices_of_loop_variables_fault_only_outside() -> None:
    text = law("y: f64[4]", "for i in range(4):", "    self.y[3 - i] = f64(i)", "    self.y[i] += self.y[i - 1 + 1]")
    assert repr(run(text).y) == "[3.0, 2.0, 2.0, 0.0]"
    for line in ("self.y[i + 1] = 1.0", "self.y[i - 1] = 1.0", "self.y[2 * i] = 1.0"):
        with pytest.raises(Fault, match=r"the index is outside \[0, 4\)"):
            run(law("y: f64[4]", "for i in range(4):", f"    {line}"))


def test_what_a_debugger_assigns_is_checked() -> None:
    self = run(law("y: f64; n: i32; v: f64[2]", "self.y = self.x"), x=2.0)
    self.n = 7  # type: ignore[attr-defined]
    assert type(self.n) is I32  # type: ignore[attr-defined]
    for name, value in (("y", "high"), ("y", I32(1)), ("n", 2**31), ("v", [1.0, 2.0])):
        with pytest.raises((IllTyped, Fault)):
            setattr(self, name, value)
    assert repr(self) == "Law(x=2.0, y=2.0, n=7, v=[0.0, 0.0], health='nominal')"


# ---- the library ------------------------------------------------------------------------------------------------------


def argument(pattern: str, sizes: dict[str, int], rng: random.Random, constant: bool) -> Any:
    """A random argument: a symmetric array where it is square, so that some of its factorisations exist."""
    extents = [int(e) if e.isdigit() else sizes[e] for e in re.findall(r"\[(\w+)\]", pattern)]
    if not extents:
        return rng.uniform(-2, 2)
    numbers = [rng.choice((0.0, -0.0, -0.0, 1.0, rng.uniform(-9, 9))) for _ in range(math.prod(extents))]
    if len(extents) == 2 and extents[0] == extents[1] and not constant:
        n = extents[0]
        numbers = [numbers[min(i, j) * n + max(i, j)] + 20.0 * (i == j) for i in range(n) for j in range(n)]
    made = array_type(SCALARS["f64"], tuple(extents)).of(numbers)
    return made.as_constant() if constant else made


def packed(value: Any) -> Any:
    numbers = value.data if isinstance(value, Array) else [value]
    return type(value), ["nan" if math.isnan(n) else struct.pack("<d", n) for n in numbers]


@pytest.mark.parametrize("name", sorted(n for n, f in library()._files.items() if f.stem not in _WITH_LOOPS))
def test_a_library_function_without_loops_gives_the_bits_of_its_source(name: str) -> None:
    functions, rng = library(), random.Random(name)
    for round_ in range(60):
        sizes = {size: rng.randint(1, 4) for size in "nmk"}
        patterns = functions._patterns(name)
        args = [
            argument(p.replace("F", "f64"), sizes, rng, constant=round_ > 9 and rng.random() < 0.5) for p in patterns
        ]
        classes, shapes = tuple(map(type, args)), [getattr(arg, "shape", ()) for arg in args]
        loops = functions._with_loops(name, classes)(*args)
        assert packed(functions._unrolled(name, classes, plain=False)(*args)) == packed(loops), f"{shapes}: {args}"


def test_large_products_are_made_row_by_row() -> None:
    rng, sizes = random.Random(1), {"n": 14, "k": 14, "m": 14}
    a, b = (argument("f64[n][n]", sizes, rng, constant=False) for _ in "ab")
    with pytest.raises(TooLarge):
        library()._unrolled("matmul", (type(a), type(b)), plain=False)
    row, column = a.data[28:42], b.data[3::14]
    total = row[0] * column[0]
    for x, y in zip(row[1:], column[1:], strict=True):
        total += x * y
    assert library().functions["matmul"](a, b)[2, 3] == total
    constant = a.as_constant()
    dense = [x * y for x, y in zip(row, column, strict=True) if x != 0.0]
    assert library().functions["matmul"](constant, b)[2, 3] == reduce(float.__add__, dense)
    mirrored = library().functions["symmetric_product"](a, b)
    assert mirrored[3, 2] == mirrored[2, 3] == total


def test_a_function_without_loops_has_at_most_1500_statements() -> None:
    writer = Writer({}, lambda name, classes: name)
    assert len({writer.fresh() for _ in range(1500)}) == 1500
    with pytest.raises(TooLarge):
        writer.fresh()


def test_structural_zeros_are_not_added() -> None:
    """(-0 * -1) * -0 is -0, and stays so beside a zero that is constant; another zero makes it +0."""
    one = array_type(SCALARS["f64"], (1, 1))
    f, p, q = one.of([-0.0]), one.of([-1.0]), one.of([0.0])
    predicted = library().functions["kf_predict_cov"]
    assert math.copysign(1.0, predicted(f, p, q.as_constant())[0, 0]) == -1.0
    assert math.copysign(1.0, predicted(f, p, q)[0, 0]) == 1.0
