# SPDX-License-Identifier: Apache-2.0
"""Functions of whole arrays: element by element, reductions, order, tables; of f32, too. Compiled and in CPython, and compared
with NumPy and SciPy."""

import math
import random
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import write_one_each
from fcsl_test_twins import Twins
from scipy.interpolate import RegularGridInterpolator

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain

NAN, INF = math.nan, math.inf


def twins_of(folder: Path, ports: str, body: str) -> Twins:
    """One algorithm, `Law`, with these dictionaries and this execute."""
    source = f"class Law:\n{ports}\n\n    def execute(self):\n" + "".join(
        f"        {line}\n" for line in body.split("\n")
    )
    return Twins(write_one_each(folder, {"law.py": source}, {"Law": {"source": "law.py"}}))


def run(twins: Twins, **inputs: Any) -> dict[str, Any]:
    """The outputs of a tick with these inputs. CPython computes the same bits."""
    for name, value in inputs.items():
        twins.set(f"law.inputs.{name}", value)
    twins.step()
    paths = [path for path in twins.native.fields if path.startswith("law.outputs.")]
    return {path.rpartition(".")[2]: twins.native.get(path) for path in paths}


def singles(values: Any) -> list[float]:
    return [float(np.float32(v)) for v in values]


def test_element_by_element(tmp_path: Path) -> None:
    ports = """    inputs = {"u": "f64[6]", "v": "f64[6]", "s": "f32[2][3]", "k": "i32[3]"}
    outputs = {
        "abs_": "f64[6]", "low": "f64[6]", "high": "f64[6]", "clamped": "f64[6]", "root": "f64[6]", "product": "f64[6]",
        "quotient": "f64[6]", "inverse": "f64[6]", "chosen": "f64[6]", "mask": "bool[6]", "finite": "bool[6]",
        "sines": "f32[2][3]", "same": "bool[3]", "wide": "f64[3]", "near": "i32[2][3]", "both": "bool[6]",
    }"""
    body = """self.abs_ = abs(self.u)
self.low = min(self.u, self.v, 0.5)
self.high = max(self.u, self.v)
self.clamped = clamp(self.u, -0.5, self.v)
self.root = sqrt(self.u)
self.product = self.u * self.v
self.quotient = self.u / self.v
self.inverse = 1 / self.u
self.mask = self.u < self.v
self.chosen = where(self.mask, self.u, self.v)
self.finite = isfinite(self.u)
self.sines = sin(self.s)
self.same = self.k == self.k[0]
self.wide = f64(self.k) * 0.5
self.near = sat_i32(self.s)
self.both = where(self.u < 0.0, self.v < 0.0, False)"""
    twins, rng = twins_of(tmp_path, ports.replace("abs_", "size"), body.replace("abs_", "size")), random.Random(1)
    for _ in range(20):
        u, v = ([rng.choice([rng.uniform(-2, 2), NAN, INF, -0.0, 0.0]) for _ in range(6)] for _ in "uv")
        s = singles(rng.uniform(-3e9, 3e9) if rng.random() < 0.2 else rng.uniform(-9, 9) for _ in range(6))
        k = [rng.randint(-3, 3) for _ in range(3)]
        found = run(twins, u=u, v=v, s=s, k=k)
        a, b = np.array(u), np.array(v)
        with np.errstate(all="ignore"):
            wanted = {
                "size": np.abs(a),
                "high": np.where(b > a, b, a),
                "root": np.sqrt(a),
                "product": a * b,
                "quotient": a / b,
                "inverse": 1 / a,
                "chosen": np.where(a < b, a, b),
                "mask": a < b,
                "finite": np.isfinite(a),
                "same": np.array(k) == k[0],
                "wide": np.array(k) * 0.5,
                "both": (a < 0) & (b < 0),
            }
            raised = np.where(-0.5 > a, -0.5, a)
            wanted["clamped"] = np.where(b < raised, b, raised)
            wanted["low"] = np.where(0.5 < np.where(b < a, b, a), 0.5, np.where(b < a, b, a))
            wanted["near"] = np.trunc(np.clip(s, -(2**31), 2**31 - 1)).astype(int)
        for name, value in wanted.items():
            np.testing.assert_array_equal(np.array(found[name]), value, err_msg=name)
        np.testing.assert_allclose(found["sines"], np.sin(np.float32(s)), rtol=3e-7, atol=1e-7)


def test_reductions_and_order(tmp_path: Path) -> None:
    ports = """    inputs = {"u": "f64[7]", "s": "f32[4]", "k": "i32[5]", "m": "f64[3][4]"}
    outputs = {
        "total": "f64", "middle": "f64[2]", "average": "f64", "least": "f64", "greatest": "f64", "at": "i64[4]",
        "sorted": "f64[7]", "total_s": "f32", "middle_s": "f32", "range_k": "i32[2]", "any": "bool",
        "all": "bool", "row": "f64",
    }"""
    body = """self.total = sum(self.u)
self.average = mean(self.u)
self.least = min(self.u)
self.greatest = max(self.u)
self.middle = [median(self.u), median(self.u[:4])]
self.sorted = sort(self.u)
self.at = [argmin(self.u), argmax(self.u), argmin(self.k), argmax(self.k)]
self.total_s = sum(self.s)
self.middle_s = median(self.s)
self.range_k = [min(self.k), max(self.k)]
self.any = any(self.u > 1.0)
self.all = all(self.u > -1.0)
self.row = dot(self.m[0], self.m[2])"""
    twins, rng = twins_of(tmp_path, ports, body), random.Random(2)
    for round_ in range(40):
        u = [rng.choice([rng.uniform(-2, 2), 1.0, NAN]) if round_ % 2 else rng.uniform(-2, 2) for _ in range(7)]
        s, k = singles(rng.uniform(-2, 2) for _ in range(4)), [rng.randint(-9, 9) for _ in range(5)]
        m = [rng.uniform(-2, 2) for _ in range(12)]
        found = run(twins, u=u, s=s, k=k, m=m)
        np.testing.assert_equal(found["total"], reduce(lambda a, b: a + b, u))
        np.testing.assert_equal(found["average"], reduce(lambda a, b: a + b, u) / 7)
        np.testing.assert_array_equal(found["sorted"], np.sort(u))  # NumPy's NaN are last, too
        np.testing.assert_equal(found["middle"], [np.sort(u)[3], 0.5 * np.sort(u[:4])[1] + 0.5 * np.sort(u[:4])[2]])
        np.testing.assert_equal(found["least"], reduce(lambda a, b: b if b < a else a, u))
        np.testing.assert_equal(found["greatest"], reduce(lambda a, b: b if b > a else a, u))
        if not any(map(math.isnan, u)):
            assert found["at"][:2] == [np.argmin(u), np.argmax(u)]
            assert found["middle"][0] == np.median(u)
        assert found["at"][2:] == [np.argmin(k), np.argmax(k)]
        assert found["total_s"] == float(reduce(lambda a, b: a + b, map(np.float32, s)))
        assert found["middle_s"] == pytest.approx(float(np.median(s)), rel=1e-6)
        assert found["range_k"] == [min(k), max(k)]
        assert (found["any"], found["all"]) == (any(x > 1 for x in u), all(x > -1 for x in u))
        assert found["row"] == pytest.approx(np.dot(m[:4], m[8:]), abs=1e-12)


AXES = ([0.0, 0.3, 1.0, 1.5, 4.0], [-1.0, 0.0, 2.0], [10.0, 20.0, 30.0, 40.0])


def test_tables(tmp_path: Path) -> None:
    ports = """    inputs = {"xs": "f64[5]", "ys": "f64[3]", "zs": "f64[4]", "singles": "f32[5]", "p": "f64[3]", "one": "f64[5]", "two": "f64[5][3]", "three": "f64[5][3][4]", "single": "f32[5]"}
    outputs = {"inside": "f64[3]", "beyond": "f64[3]", "cell": "i64", "low": "f32"}"""
    body = """x, y, z = self.p
self.inside[0] = interp(x, self.xs, self.one)
self.inside[1] = interp2(x, y, self.xs, self.ys, self.two)
self.inside[2] = interp3(x, y, z, self.xs, self.ys, self.zs, self.three)
self.beyond[0] = extrapolate(x, self.xs, self.one)
self.beyond[1] = extrapolate2(x, y, self.xs, self.ys, self.two)
self.beyond[2] = extrapolate3(x, y, z, self.xs, self.ys, self.zs, self.three)
self.cell = interp_cell(x, self.xs)
self.low = interp(f32(x), self.singles, self.single)"""
    twins, rng = twins_of(tmp_path, ports, body), random.Random(3)
    for name, values in zip(("xs", "ys", "zs"), AXES, strict=True):
        twins.set(f"law.inputs.{name}", values)
    twins.set("law.inputs.singles", singles(AXES[0]))
    tables = [
        np.array([rng.uniform(-5, 5) for _ in range(n)]).reshape(s) for n, s in ((5, 5), (15, (5, 3)), (60, (5, 3, 4)))
    ]
    for name, table in zip(("one", "two", "three"), tables, strict=True):
        twins.set(f"law.inputs.{name}", table.ravel().tolist())
    twins.set("law.inputs.single", singles(tables[0]))
    grid = [
        RegularGridInterpolator(AXES[: n + 1], t, bounds_error=False, fill_value=None) for n, t in enumerate(tables)
    ]
    corners = [[x, y, z] for x in (0.0, 0.3, 4.0) for y in AXES[1] for z in (10.0, 40.0)]
    points = [[rng.uniform(-1, 5), rng.uniform(-2, 3), rng.uniform(0, 50)] for _ in range(60)] + corners
    for point in points:
        found = run(twins, p=point)
        within = [float(np.clip(v, axis[0], axis[-1])) for v, axis in zip(point, AXES, strict=True)]
        for n in range(3):
            assert found["beyond"][n] == pytest.approx(float(grid[n](point[: n + 1])[0]), rel=1e-9, abs=1e-9)
            assert found["inside"][n] == pytest.approx(float(grid[n](within[: n + 1])[0]), rel=1e-9, abs=1e-9)
        assert found["inside"][0] == pytest.approx(float(np.interp(point[0], AXES[0], tables[0])), abs=1e-12)
        assert found["cell"] == min(max(int(np.searchsorted(AXES[0], point[0], side="right")) - 1, 0), 3)
        assert found["low"] == pytest.approx(found["inside"][0], abs=1e-5)
    for i, x in enumerate(AXES[0]):  # at a breakpoint the value is that of the table, exactly
        assert run(twins, p=[x, 0.0, 20.0])["inside"] == [tables[0][i], tables[1][i, 1], tables[2][i, 1, 1]]
    assert all(map(math.isnan, run(twins, p=[NAN, NAN, NAN])["inside"]))


def test_linear_algebra_of_f32(tmp_path: Path) -> None:
    """The operations of f64, each rounded to f32: those of NumPy on float32, in the documented order."""
    ports = """    inputs = {"a": "f32[3][3]", "b": "f32[3][3]", "v": "f32[3]", "q": "f32[4]"}
    outputs = {
        "product": "f32[3][3]", "image": "f32[3]", "length": "f32", "sum": "f32[3][3]", "solved": "f32[3]", "turned": "f32[3]",
        "predicted": "f32[3][3]", "kept": "f32[3][3]",
    }"""
    body = """self.product = matmul(self.a, self.b)
self.image = matvec(self.a, self.v)
self.length = norm(self.v)
self.sum = self.a + eye(3) + outer(self.v, [1.0, 0.5, 0.25])
self.solved = solve(self.a, self.v)
self.turned = quat_rotate(quat_normalize(self.q), self.v)
self.predicted = kf_predict_cov(self.a, symmetric_product(self.b, transpose(self.b)), diag(self.v))
rows = zeros(3, 3)
rows[1] = self.v
self.kept = rows"""
    twins, rng, f = twins_of(tmp_path, ports, body), random.Random(4), np.float32
    for _ in range(20):
        a, b, v, q = (singles(rng.uniform(-2, 2) for _ in range(n)) for n in (9, 9, 3, 4))
        found = run(twins, a=a, b=b, v=v, q=q)
        A, B, V = np.array(a, f).reshape(3, 3), np.array(b, f).reshape(3, 3), np.array(v, f)
        product = [[(A[i, 0] * B[0, j] + A[i, 1] * B[1, j]) + A[i, 2] * B[2, j] for j in range(3)] for i in range(3)]
        np.testing.assert_array_equal(np.reshape(found["product"], (3, 3)), np.array(product, f))
        np.testing.assert_array_equal(
            found["image"], [(A[i, 0] * V[0] + A[i, 1] * V[1]) + A[i, 2] * V[2] for i in range(3)]
        )
        assert found["length"] == float(np.sqrt((V[0] * V[0] + V[1] * V[1]) + V[2] * V[2]))
        np.testing.assert_array_equal(np.reshape(found["kept"], (3, 3)), [[0, 0, 0], V, [0, 0, 0]])
        scale = np.linalg.cond(A.astype(float))
        np.testing.assert_allclose(
            found["solved"], np.linalg.solve(A.astype(float), V), rtol=1e-5 * scale, atol=1e-5 * scale
        )
        predicted = A @ B @ B.T @ A.T + np.diag(V)
        np.testing.assert_allclose(np.reshape(found["predicted"], (3, 3)), predicted, rtol=1e-3, atol=1e-3)


def test_the_terms_of_structural_zeros_are_omitted_in_f32(tmp_path: Path) -> None:
    source = """PICK: "f32[2][3]" = [[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]


class Law:
    inputs = {"v": "f32[3]"}
    outputs = {"y": "f32[2]"}

    def execute(self):
        self.y = matvec(PICK, self.v)
"""
    twins = Twins(write_one_each(tmp_path, {"law.py": source}, {"Law": {"source": "law.py"}}))
    assert run(twins, v=[3.0, NAN, INF])["y"] == [3.0, INF]


def test_a_table_does_not_make_an_algorithm_fault(tmp_path: Path) -> None:
    ports = """    inputs = {"x": "f64"}\n    outputs = {"y": "f64", "z": "f64"}"""
    body = "self.y = interp(self.x, [0.0, 1.0, 2.0], [3.0, 4.0, 9.0])\nself.z = median([self.x, self.y, 1.0])"
    source = f"class Law:\n{ports}\n\n    def execute(self):\n        {body.splitlines()[0]}\n        {body.splitlines()[1]}\n"
    config = write_one_each(tmp_path, {"law.py": source}, {"Law": {"source": "law.py"}})
    checked = compile_machine(config, toolchain(), until="schedule").checked
    assert checked is not None and not any(f.faults for f in checked.program.functions.values())


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("self.y = self.m * self.m", "E413", "`*` between f64[2][2] and f64[2][2]"),
        ("self.v = 1 + self.v", "E413", "`+` between f64 and f64[2]"),
        ("self.v = min(self.v, self.u)", "E413", "`min` between f64[2] and f64[3]"),
        ("self.y = norm(self.k)", "E418", "`norm`: a is of f64 or f32, not of i32"),
        ("self.y = dot(self.v, self.s)", "E418", "`dot`: a is of f64, but b of f32"),
        ("self.y = sum(self.k)", "E418", "`sum`: x is of f64 or f32, not of i32"),
        ("self.ok = 0.0 < self.v < 1.0", "E413", "a chain of comparisons on arrays"),
        ("self.ok = self.v < 1.0", "E402", "`self.ok` is bool, not bool[2]"),
        ("self.y = where(self.v, 1.0, 2.0)", "E415", "no `where` between f64[2] and f64 and f64"),
        ("self.y = interp(self.y, [1.0], [2.0])", "E418", "`interp`: xs has one breakpoint, and a table two or more"),
        ("self.y = extrapolate2(1.0, 2.0, self.v, [2.0], [[1.0], [2.0]])", "E418", "`extrapolate2`: ys has one"),
    ],
)
def test_wrong(tmp_path: Path, line: str, code: str, message: str) -> None:
    ports = """    inputs = {"m": "f64[2][2]", "u": "f64[3]", "s": "f32[2]", "k": "i32[2]"}
    outputs = {"y": "f64", "ok": "bool"}
    state = {"v": "f64[2]"}"""
    with pytest.raises(DiagnosticError) as caught:
        twins_of(tmp_path, ports, line)
    first = caught.value.diagnostics[0]
    assert first.code == code and message in first.message, first
