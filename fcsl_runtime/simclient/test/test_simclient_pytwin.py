# SPDX-License-Identifier: Apache-2.0
"""PyTwin: the bits of AlgTwin in every field of every tick, records included; breakpoints; exceptions that are no faults."""

from __future__ import annotations

import bdb
import json
import math
import random
import struct
import sys
from collections.abc import Callable, Iterator
from ctypes import CFUNCTYPE, c_uint64, c_void_p
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import pytest

from simclient import AlgTwin, PyTwin, TwinError
from simclient.bag.digest import digest
from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[3]
RECORDS = ("inputs", "outputs", "parameters", "state")
LANDER = ROOT / "examples/lander/fc/lander_control.json"

MIXED = """
from fcsl_builtins import extern, f64, hw_read_adc, hw_read_gpio, hw_read_u32, hw_write_gpio, hw_write_u32, i64, u32


@extern(header="board.h", lang="c")
def board_scale(x: "f64[2]", pose: "Pose", n: i32) -> "Pose": ...


@extern(header="board.h", lang="c")
def board_count(step: u32) -> i64: ...


@extern(header="board.h", lang="c")
def board_note(x: f32) -> None: ...


class Law:
    inputs = {"n": "i32"}
    outputs = {
        "pose": "Pose",
        "sum": "i32",
        "single": "f32",
        "volts": "f64",
        "counted": "i64",
        "level": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {"gain": "f32"}
    state = {"history": "Pose[2]"}

    def execute(self):
        self.volts = 0.8e-3 * f64(hw_read_adc(3))
        self.level = hw_read_gpio(u32(self.n & 2047))
        turns = hw_read_u32(0x40000024)
        hw_write_gpio(17, self.volts > 0.5)
        duty = u32(250) if self.level else 1000
        hw_write_u32(0x40000034, duty)
        self.counted = board_count(u32(2) + 1) + i64(turns)
        self.history[0] = self.history[1]
        self.history[1] = board_scale([self.volts, 2], self.history[0], self.n)
        board_note(self.single)
        self.pose = self.history[self.n % 3]
        self.sum += self.n * 1000000000
        self.single = self.gain * f32(self.volts) / 3
        if self.n == 1:
            self.transition_request = "SWITCH"
"""

BOARD = """
#ifndef BOARD_H
#define BOARD_H
#include "mixed.h"
void board_scale(const double *x, const mixed_Pose_t *pose, int32_t n, mixed_Pose_t *result);
int64_t board_count(uint32_t step);
void board_note(float x);
#endif
"""

BOARD_C = """
#include "board.h"
static float noted;
void board_scale(const double *x, const mixed_Pose_t *pose, int32_t n, mixed_Pose_t *result)
{
    for (int i = 0; i < 3; i++) {
        result->position[i] = pose->position[i] * x[i % 2] + n;
    }
    for (int i = 0; i < 4; i++) {
        result->quality[i] = pose->quality[3 - i] + 0.1f * (float)i + noted;
    }
    result->valid = !pose->valid;
}
int64_t board_count(uint32_t step)
{
    return -7 * (int64_t)step;
}
void board_note(float x)
{
    noted = x;
}
"""


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine with structs, hardware, externs, faults, rates, a delayed connection and a clock to watch it."""
    folder = tmp_path_factory.mktemp("mixed")
    (folder / "externs").mkdir()
    (folder / "law.py").write_text(MIXED)
    (folder / "externs/board.h").write_text(BOARD)
    (folder / "externs/board.c").write_text(BOARD_C)
    state = {"schedule": {"fast": 100, "slow": {"hz": 25, "phase": 1}}}
    config = {
        "tick_hz": 100,
        "initial_state": "A",
        "structs": {"Pose": {"position": "f64[3] m", "quality": "f32[2][2]", "valid": "bool"}},
        "algorithms": {"Law": {"source": "law.py"}},
        "targets": {"simulation": {"sources": ["externs/board.c"], "include": ["externs"]}},
        "instances": {
            "fast": {"algorithm": "Law", "parameters": {"gain": 0.1}, "max_wcet_us": 100},
            "slow": {"algorithm": "Law", "parameters": {"gain": -2}, "frozen": True},
        },
        "connections": [{"from": "fast.sum", "to": "slow.n", "delayed": True, "initial": 2}],
        "states": {"A": state, "B": {"schedule": {"slow": 50}}},
        "transitions": [
            {"from": "A", "request": "SWITCH", "to": "B", "priority": 1},
            {"from": "B", "to": "A", "priority": 1, "health": {"instance": "slow", "in": ["failed"]}},
        ],
    }
    path = folder / "mixed.json"
    path.write_text(json.dumps(config))
    return path


def bits(value: Any) -> Any:
    if isinstance(value, list):
        return [bits(v) for v in value]
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value)
    return value


class Pair:
    """Both twins of one machine; what is done to one is done to the other."""

    def __init__(self, config: Path):
        self.compiled, self.python = AlgTwin.from_config(config), PyTwin.from_config(config)

    def each(self, what: Callable[[AlgTwin], Any]) -> None:
        for twin in (self.compiled, self.python):
            what(twin)

    def tick(self) -> None:
        """One tick of both; then every field has the same bits."""
        self.each(lambda twin: twin.tick())
        for field in self.compiled.fields():
            one, other = self.compiled.get_value(field.path), self.python.get_value(field.path)
            tick = self.compiled.get_value("machine.tick")
            assert bits(one) == bits(other), f"after tick {tick}: {field.path}: compiled {one}, CPython {other}"

    def close(self) -> None:
        self.each(lambda twin: twin.close())


@pytest.fixture
def pair_of() -> Iterator[Callable[[Path], Pair]]:
    opened: list[Pair] = []

    def make(config: Path) -> Pair:
        opened.append(Pair(config))
        return opened[-1]

    yield make
    for pair in opened:
        pair.close()


# ---- the same bits ----------------------------------------------------------------------------------------------------


def fly_lander(pair: Pair, ticks: int) -> list[str]:
    """Up to the target, over the top, down and onto the ground, through noise and samples that are no numbers."""
    rng, z, v = random.Random(1), 0.0, 8.0
    states = []
    for k in range(ticks):
        v -= 0.02 if z > 40.0 or v < 7.9 else 0.0
        z = max(0.0, z + 0.1 * v)
        sample = (z + rng.gauss(0, 0.5), v + rng.gauss(0, 0.3))
        if k % 97 == 5:
            sample = (math.nan, math.inf)
        for name, value in zip(("pos_z", "vel_z"), sample, strict=True):
            pair.each(lambda twin, name=name, value=value: twin.set(f"sensors.outputs.{name}", value))  # type: ignore[misc]
        pair.tick()
        states.append(pair.compiled.state())
    return states


def test_lander_flies_the_same(pair_of: Callable[[Path], Pair]) -> None:
    pair = pair_of(LANDER)
    states = fly_lander(pair, 500)
    assert {"ASCENT", "COAST"} <= set(states)
    pair.each(lambda twin: twin.set_state("DESCENT"))
    for k in range(150):
        pair.each(lambda twin, k=k: twin.set("sensors.outputs.pos_z", 30.0 - 0.2 * k))  # type: ignore[misc]
        pair.each(lambda twin: twin.set("sensors.outputs.vel_z", -1.0))
        pair.tick()
    pair.each(lambda twin: twin.set("sensors.outputs.pos_z", math.nan))
    for _ in range(20):
        pair.tick()
    assert pair.python.state() == "SAFE" and pair.python.get_value("monitor.outputs.health") == "failed"


@pytest.mark.parametrize("name", ["minimal/minimal", "ahrs/ahrs"])
def test_examples_run_the_same(pair_of: Callable[[Path], Pair], name: str) -> None:
    pair, rng = pair_of(ROOT / f"examples/{name}.json"), random.Random(name)
    inputs = [f for f in pair.compiled.fields() if f.writable and f.role == "output" and f.type == "f64"]
    for _ in range(200):
        for field in inputs:
            values = [rng.uniform(-10, 10) for _ in range(field.count)]
            value = values if field.shape else values[0]
            pair.each(lambda twin, path=field.path, value=value: twin.set(path, value))  # type: ignore[misc]
        pair.tick()


def test_a_filter_of_many_states_runs_the_same(pair_of: Callable[[Path], Pair]) -> None:
    """The quadrotor's, with 19 states: products that are too large for functions without loops."""
    pair, rng = pair_of(ROOT / "examples/quadrotor/fc/quadrotor.json"), random.Random(3)
    inputs = [f for f in pair.compiled.fields() if f.writable and f.role == "output" and f.type == "f64"]
    for k in range(40):
        for field in inputs:
            values = [rng.uniform(-3, 3) for _ in range(field.count)]
            value = values if field.shape else values[0]
            pair.each(lambda twin, path=field.path, value=value: twin.set(path, value))  # type: ignore[misc]
        if k % 10 == 5:
            pair.each(lambda twin: twin.set_state("MISSION"))
        pair.tick()


def fly_mixed(pair: Pair, ticks: int) -> None:
    """Readings, indices and sums of every kind, overruns injected, the machine's clock running wild."""
    rng = random.Random(2)
    for k in range(ticks):
        readings = (
            rng.randrange(2500),
            rng.randrange(2**32),
            rng.random() < 0.5,
            rng.choice([0, 1, 2, -1, 0]),
        )

        def put(twin: AlgTwin, readings: tuple[int, int, bool, int] = readings, k: int = k) -> None:
            hardware = twin.hardware
            hardware.adc[3], hardware.registers[0x40000024], hardware.gpio[0] = readings[:3]
            twin.set("fast.inputs.n", readings[3] if k % 50 else 1)
            if k % 31 == 7:
                twin.overrun("fast")
            if k % 23 == 5:
                twin.fault("slow" if k % 2 else "fast")

        pair.each(put)
        pair.tick()
        one, other = pair.compiled.hardware, pair.python.hardware
        assert one.gpio[17] == other.gpio[17]
        assert one.registers[0x40000034] == other.registers[0x40000034] > 0


def test_structs_hardware_externs_and_faults_are_the_same(pair_of: Callable[[Path], Pair], mixed: Path) -> None:
    pair = pair_of(mixed)
    fly_mixed(pair, 300)
    for instance in ("fast", "slow"):
        assert pair.python.get_value(f"{instance}.counters.faults") > 5
    assert pair.python.get_value("fast.counters.overruns") > 3 and pair.python.hardware.failures > 0
    assert pair.compiled.hardware.failures == pair.python.hardware.failures


def test_the_clock_of_the_host_is_heard(pair_of: Callable[[Path], Pair], mixed: Path) -> None:
    pair, clocks = pair_of(mixed), []
    for twin in (pair.compiled, pair.python):
        readings = iter(range(0, 10**9, 101_000))  # ns: every execute of `fast` takes 101 us of its 100
        clocks.append(CFUNCTYPE(c_uint64, c_void_p)(lambda _, readings=readings: next(readings)))
        set_clock = twin._run._lib.fcsl_run_set_clock
        set_clock.argtypes, set_clock.restype = [c_void_p, c_void_p, c_void_p], None
        set_clock(twin._run.handle(), clocks[-1], None)
    for _ in range(8):
        pair.tick()
    assert pair.python.get_value("fast.counters.overruns") == 8


def test_a_checkpoint_of_one_continues_in_the_other(pair_of: Callable[[Path], Pair]) -> None:
    pair = pair_of(LANDER)
    fly_lander(pair, 60)
    compiled, python = pair.compiled.save(), pair.python.save()
    pair.compiled.restore(python)
    pair.python.restore(compiled)
    fly_lander(pair, 20)


def test_records_are_equal_and_replay(pair_of: Callable[[Path], Pair], mixed: Path, tmp_path: Path) -> None:
    """Both bags have one digest, and the compiled machine reproduces what CPython recorded."""
    pair = pair_of(mixed)
    pair.compiled.record(tmp_path / "compiled", "one")
    pair.python.record(tmp_path / "python", "two")
    fly_mixed(pair, 120)
    pair.close()
    assert digest(tmp_path / "compiled") == digest(tmp_path / "python")
    verdict = replay(tmp_path / "python", str(mixed))
    assert verdict.identical and verdict.ticks == 120, str(verdict)


# ---- user code, debuggers ---------------------------------------------------------------------------------------------


class Debugger(bdb.Bdb):
    """Stops at breakpoints, and remembers the value of an expression there."""

    def __init__(self, expression: str):
        super().__init__()
        self.expression, self.seen = expression, list[tuple[int, Any]]()

    def user_line(self, frame: FrameType) -> None:
        if self.break_here(frame):
            self.seen.append((frame.f_lineno, eval(self.expression, frame.f_globals, frame.f_locals)))
        self.set_continue()


class Stepper(bdb.Bdb):
    """A user who steps line by line through what runs of one file, and looks at the locals and at `self` in each."""

    def __init__(self, file: Path):
        super().__init__()
        self.file = str(file)
        self.lines, self.locals, self.selves = list[tuple[str, int]](), list[dict[str, Any]](), list[Any]()

    def user_line(self, frame: FrameType) -> None:
        name = frame.f_code.co_name
        if frame.f_code.co_filename == self.file and name in ("start", "execute", "halved"):
            self.lines.append((name, frame.f_lineno))
            self.locals.append({n: str(value) for n, value in frame.f_locals.items() if n != "self"})
            self.selves.append(frame.f_locals.get("self"))
        self.set_step()


def line_of(file: Path, text: str) -> int:
    return next(n for n, line in enumerate(file.read_text().splitlines(), start=1) if text in line)


def test_a_breakpoint_in_the_algorithm_stops_there() -> None:
    source = ROOT / "examples/lander/fc/algorithms/kalman.py"
    line = line_of(source, "self.P = kf_predict_cov(F, self.P, Q)")
    debugger = Debugger("str((g, Q, self.x, self.dt, self))")
    assert debugger.set_break(str(source), line) is None
    with PyTwin.from_config(LANDER) as twin:
        twin.set("sensors.outputs.pos_z", 4.0)
        twin.tick()
        debugger.runcall(twin.tick, 2)
        q = 1.2500000000000002e-07
        expected = f"([5e-05, 0.01], [[6.25e-10, {q}], [{q}, 2.5e-05]], [4.000119, 0.023799999999999998], 0.01, "
        expected += "Kalman(altimeter=4.0, velocimeter=0.0, pos_valid=True, vel_valid=True, "
        assert len(debugger.seen) == 2 and debugger.seen[0][0] == line
        assert debugger.seen[0][1].startswith(expected), debugger.seen
        assert "pos_z=4.0, vel_z=0.0, pos_sigma=0.5, vel_sigma=0.3, " in debugger.seen[0][1]
        assert twin.tick() == 4


STEPPED = '''\
"""Two algorithms, and what one of them uses."""

from fcsl_builtins import f64

HALF = 0.5


def halved(x: f64) -> f64:
    y = x * HALF
    return y


class Law:
    """Ports in every dictionary, a struct among them."""

    inputs = {"speed": "f64"}
    outputs = {"pose": "Pose", "transition_request": "TransitionRequest"}
    parameters = {"gain": "f64"}
    state = {"count": "i64"}

    def start(self) -> None:
        self.count = 40

    def execute(self) -> None:
        half = halved(self.speed)
        self.pose.height = (
            half
            * self.gain
        )
        for i in range(2):
            self.count += i
        if self.pose.height > 2.0:
            self.transition_request = "STOP"
        self.count += 1


class Plain:
    outputs = {"ticks": "i64"}

    def execute(self):
        self.ticks += 1
'''


@pytest.fixture
def stepped(tmp_path: Path) -> Path:
    (tmp_path / "law.py").write_text(STEPPED)
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": {"Pose": {"height": "f64", "valid": "bool"}},
        "algorithms": {"Law": {"source": "law.py"}, "Plain": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law", "parameters": {"gain": 3}}, "plain": {"algorithm": "Plain"}},
        "states": {"A": {"schedule": {"law": 1, "plain": 1}}, "B": {"schedule": {"plain": 1}}},
        "transitions": [{"from": "A", "to": "B", "request": "STOP"}],
    }
    (tmp_path / "craft.json").write_text(json.dumps(config))
    return tmp_path / "craft.json"


def test_stepping_shows_the_users_file_line_by_line(stepped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same lines and locals as the class shows that CPython imports; and `self` has the ports and nothing else."""
    file = stepped.parent / "law.py"
    ours, theirs = Stepper(file), Stepper(file)
    with ours.runcall(PyTwin.from_config, stepped) as twin:
        twin.set("law.inputs.speed", 2.0)
        ours.runcall(twin.tick)
        assert twin.get_value("machine.next_state") == "B" and twin.get_value("law.state.count") == 42
    monkeypatch.syspath_prepend(stepped.parent)
    import law  # type: ignore[import-not-found]

    plain, other = law.Law(), law.Plain()
    plain.speed, plain.gain, plain.pose, other.ticks = 2.0, 3.0, SimpleNamespace(), 0
    for method in (plain.start, plain.execute, other.execute):
        theirs.runcall(method)
    assert ours.lines == theirs.lines and len(ours.lines) > 15
    assert ours.locals == theirs.locals and {"half": "1.0", "i": "1"} in ours.locals
    health = {"health"}
    for own, (name, _) in zip(ours.selves, ours.lines, strict=True):
        if name == "halved":
            assert own is None
            continue
        cls = getattr(law, type(own).__name__)
        declared = {port for record in RECORDS for port in getattr(cls, record, {})}
        assert set(vars(own)) == declared | health
        assert {n for n in dir(own) if not n.startswith("_")} == declared | health | {"execute"} | {"start"} & vars(
            cls
        ).keys()


def test_a_debugger_may_change_what_it_sees(stepped: Path) -> None:
    """Outputs and state, as a debugger's console assigns them; what cannot be held is refused there."""
    debugger = Debugger("(setattr(self, 'count', 7), setattr(self.pose, 'valid', True))")
    assert debugger.set_break(str(stepped.parent / "law.py"), line_of(stepped.parent / "law.py", "half = ")) is None
    with PyTwin.from_config(stepped) as twin:
        debugger.runcall(twin.tick)
        assert twin.get_value("law.state.count") == 9 and twin.get_value("law.outputs.pose.valid") is True


class Quitter(bdb.Bdb):
    """A user who leaves the debugger at the first line of a file."""

    def __init__(self, name: str):
        super().__init__()
        self.name = name

    def user_line(self, frame: FrameType) -> None:
        if frame.f_code.co_filename.endswith(self.name):
            self.set_quit()


@pytest.mark.parametrize("recording", [False, True])
def test_what_is_no_fault_comes_out_and_undoes_its_tick(tmp_path: Path, recording: bool) -> None:
    with PyTwin.from_config(LANDER) as twin, AlgTwin.from_config(LANDER) as other:
        if recording:
            twin.record(tmp_path / "bag")
            other.record(tmp_path / "other")
        twin.tick(3)
        before = twin.save()
        debugger = Quitter("engine.py")
        debugger.reset()
        sys.settrace(debugger.trace_dispatch)
        with pytest.raises(bdb.BdbQuit):
            twin.tick(5)
        assert twin.save() == before and twin.get_value("machine.tick") == 3
        assert twin.tick() == 4 and other.tick(4) == 4
        assert twin.save() == other.save()
    if recording:
        assert digest(tmp_path / "bag") == digest(tmp_path / "other")


def test_ctrl_c_comes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    with PyTwin.from_config(LANDER) as twin:

        def interrupt(*_: Any) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(twin._run._python._reference, "_arbitrate", interrupt)  # type: ignore[attr-defined]
        with pytest.raises(KeyboardInterrupt):
            twin.tick()
        monkeypatch.undo()
        assert twin.tick() == 1


def test_what_goes_wrong_in_real_time_comes_out_of_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    with PyTwin.from_config(LANDER) as twin:
        monkeypatch.setattr(twin._run._python._reference, "_arbitrate", lambda *_: 1 // 0)  # type: ignore[attr-defined]
        twin.resume()
        assert twin._thread is not None
        twin._thread.join(timeout=30)
        with pytest.raises(ZeroDivisionError):
            twin.pause()


def test_a_start_that_faults_is_refused_alike(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        'class Law:\n    state = {"n": "i32"}\n\n    def start(self):\n        self.n = 1 // self.n\n\n    def execute(self):\n        pass\n'
    )
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"one": {"algorithm": "Law"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    (tmp_path / "wrong.json").write_text(json.dumps(config))
    for kind in (AlgTwin, PyTwin):
        with pytest.raises(TwinError, match=r"start\(\) of instance 'one' faulted: law.py:5:18: the divisor is zero$"):
            kind.from_config(tmp_path / "wrong.json")


def test_libraries_have_no_source(probe: Path) -> None:
    with pytest.raises(
        TwinError, match=r"PyTwin runs the algorithms' sources; open the machine's JSON with from_config"
    ):
        PyTwin.from_library(probe)
