# SPDX-License-Identifier: Apache-2.0
"""The stack of a step, measured by painting while faults and healths are injected, against the bound of the build."""

from __future__ import annotations

import ctypes as c
import platform
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from fcsl_test_abi import Machine, write_machine

from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.stack import RED_ZONE_BYTES, stack_bound

pytestmark = pytest.mark.skipif(platform.machine() != "x86_64", reason="painted.c is of x86-64")

_PAINTED = Path(__file__).resolve().parents[2] / "scripts/verify/binary/painted.c"

#: Its array dominates the stack of a step.
LARGE = """
class Large:
    inputs = {{"x": "f64"}}
    outputs = {{"y": "f64"}}

    def execute(self):
        t = zeros({size})
        for i in range({size}):
            t[i] = self.x * f64(i)
        self.y = dot(t, t)
"""


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Machine], int]:
    """Bytes of stack of one step."""
    library = tmp_path_factory.mktemp("painted") / "painted.so"
    subprocess.run(["cc", "-std=gnu11", "-O2", "-shared", "-fPIC", _PAINTED, "-o", library], check=True)
    painted = c.CDLL(str(library))
    painted.painted_call.argtypes = [c.c_void_p, c.c_uint64 * 4, c.c_double * 3]
    painted.painted_used.restype = c.c_size_t

    def measure(m: Machine) -> int:
        painted.painted_begin()
        step = c.cast(m.d.step, c.c_void_p)
        painted.painted_call(step, (c.c_uint64 * 4)(m.base, c.addressof(m._host)), (c.c_double * 3)())
        return int(painted.painted_used())

    return measure


def build(folder: Path, size: int) -> tuple[Machine, int]:
    config = {
        "tick_hz": 100,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Large"}},
        "states": {"A": {"schedule": {"one": 100}}},
    }
    path = write_machine(folder, "large", config, {"large": LARGE.format(size=size)})
    (made,) = build_library([path], folder / "liblarge.so")
    if made.stack_bound is None:
        pytest.skip("this C compiler does not tell its frames")
    return Machine(folder / "liblarge.so", "large"), made.stack_bound


def test_an_injected_health_needs_no_second_frame(tmp_path: Path, used: Callable[[Machine], int]) -> None:
    m, bound = build(tmp_path, 1000)
    inject = m.byte(m.instances["one"].inject_fault_offset)
    measured = []
    for value in range(4):  # nothing, a fault, degraded, failed
        inject[0] = value
        measured.append(used(m))
        assert inject[0] == 0 and m.get("machine.tick") == value + 1
    assert m.get("one.outputs.health") == "failed" and m.get("one.counters.faults") == 1
    assert all(8000 < bytes_ <= bound for bytes_ in measured) and bound < 8000 + 1000


def test_the_measurement_sees_frames(tmp_path: Path, used: Callable[[Machine], int]) -> None:
    """The control: a doubled array appears in measurement and bound."""
    (small, told_small), (large, told_large) = build(tmp_path / "1", 1000), build(tmp_path / "2", 2000)
    for grown in (used(large) - used(small), told_large - told_small):
        assert 8000 <= grown < 8500


def test_a_function_folded_into_another_counts_as_the_deepest(tmp_path: Path) -> None:
    """gcc keeps one of two functions with equal code, and its graph contains calls of both."""
    node = 'node: {{ title: "m.c:{0}" label: "{0}\\nm.c:1:1\\n{1} bytes (static)\\n0 dynamic objects" }}'
    edge = 'edge: {{ sourcename: "m.c:{0}" targetname: "m.c:{1}" label: "m.c:1:1" }}'
    lines = [node.format(*n) for n in (("fcsl_step_m", 16), ("tick_a", 32), ("deep", 4096), ("user", 8))]
    lines += [edge.format(*e) for e in (("fcsl_step_m", "tick_a"), ("fcsl_step_m", "user"), ("user", "deep_too"))]
    graph = tmp_path / "m.ci"
    graph.write_text("\n".join(lines))
    assert stack_bound("m", [graph]) == 16 + 8 + 4096 + RED_ZONE_BYTES


def test_a_frame_with_a_dynamic_object_has_no_bound(tmp_path: Path) -> None:
    """Also where gcc calls the frame bounded: such a build has no bound of the stack, rather than one that is too small."""
    node = 'node: {{ title: "m.c:fcsl_step_m" label: "fcsl_step_m\\nm.c:1:1\\n64 bytes ({0})\\n{1} dynamic objects" }}'
    graph = tmp_path / "m.ci"
    for kind, objects, bound in (
        ("static", 0, 64 + RED_ZONE_BYTES),
        ("dynamic,bounded", 0, 64 + RED_ZONE_BYTES),
        ("dynamic,bounded", 1, None),
        ("dynamic", 1, None),
    ):
        graph.write_text(node.format(kind, objects))
        assert stack_bound("m", [graph]) == bound, (kind, objects)
