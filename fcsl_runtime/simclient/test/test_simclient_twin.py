# SPDX-License-Identifier: Apache-2.0
"""AlgTwin and PyTwin: values in and out, time, checkpoints, and what they say when they refuse."""

from __future__ import annotations

import math
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import PROBE, ROOT
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simclient import AlgTwin, PyTwin, TwinError
from simclient.library import runtime_program

SCALARS: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "i32": st.integers(-(2**31), 2**31 - 1),
    "i64": st.integers(-(2**63), 2**63 - 1),
    "u32": st.integers(0, 2**32 - 1),
    "u64": st.integers(0, 2**64 - 1),
    "f32": st.floats(width=32),
    "f64": st.floats(),
    "Health": st.sampled_from(["nominal", "degraded", "failed", "stale"]),
    "TransitionRequest": st.sampled_from(["", "tr_GO", "tr_STOP"]),
}


@pytest.fixture(params=["compiled", "CPython"])
def twin(request: pytest.FixtureRequest) -> Iterator[AlgTwin]:
    """The probe as it may be hosted: compiled from its sources, run by CPython."""
    with (AlgTwin if request.param == "compiled" else PyTwin).from_config(PROBE) as opened:
        yield opened


def same(a: Any, b: Any) -> bool:
    """Equal to the bit, except that every NaN is every other."""
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return isinstance(b, float) and ((a != a and b != b) or struct.pack("d", a) == struct.pack("d", b))
    return type(a) is type(b) and a == b


def values(type_name: str, shape: tuple[int, ...]) -> st.SearchStrategy[Any]:
    strategy = SCALARS[type_name]
    for extent in reversed(shape):
        strategy = st.lists(strategy, min_size=extent, max_size=extent)
    return strategy


# ---- values -----------------------------------------------------------------------------------------------------------


def test_starts_paused_at_tick_0_in_the_initial_state(twin: AlgTwin) -> None:
    assert twin.get_value("machine.tick") == 0 and twin.state() == "IDLE" and not twin.running
    assert twin.tick() == 1 and twin.tick(9) == 10 and twin.tick(0) == 10
    assert twin.get_value("machine.tick") == 10


@pytest.mark.filterwarnings("ignore::simclient.OverwrittenWarning")
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_is_set_is_read_back(twin: AlgTwin, data: st.DataObject) -> None:
    field = data.draw(st.sampled_from([f for f in twin.fields() if f.writable]))
    indices = [data.draw(st.integers(0, e - 1)) for e in field.shape[: data.draw(st.integers(0, len(field.shape)))]]
    value = data.draw(values(field.type, field.shape[len(indices) :]))
    before = twin.get_value(field.path)
    path = field.path + data.draw(
        st.sampled_from(["".join(f"[{i}]" for i in indices), f"{indices}" if indices else ""])
    )
    twin.set(path, value)
    assert same(twin.get_value(path), value)
    # Nothing beside the selected part has changed.
    whole = twin.get_value(field.path)
    part: Any = before
    if indices:
        for i in indices[:-1]:
            part = part[i]
        part[indices[-1]] = value
        assert same(whole, before)
    else:
        assert same(whole, value)


def test_arrays_are_nested_lists_and_may_be_set_from_numpy(twin: AlgTwin) -> None:
    twin.set("source.outputs.grid", np.arange(6, dtype=np.float32).reshape(2, 3))
    assert twin.get_value("source.outputs.grid") == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert twin.get_value("source.outputs.grid[1]") == [3.0, 4.0, 5.0]
    assert twin.get_value("source.outputs.grid[1][2]") == twin.get_value("source.outputs.grid[1, 2]") == 5.0
    twin.set("source.outputs.vec", (1, np.float64(2.5), 3))
    twin.set("source.outputs.small", np.int64(-7))
    twin.set("source.outputs.flag", np.bool_(True))
    assert twin.get_value("source.outputs.vec") == [1.0, 2.5, 3.0]
    assert twin.get_value("source.outputs.small") == -7 and twin.get_value("source.outputs.flag") is True


def test_large_integers_are_exact_floats(twin: AlgTwin) -> None:
    twin.set("source.outputs.real", 2**60)
    twin.set("source.outputs.single", 2**30)
    assert twin.get_value("source.outputs.real") == 2**60 and twin.get_value("source.outputs.single") == 2**30
    twin.set("source.outputs.real", float(2**53 + 1))  # a float is what it is
    assert twin.get_value("source.outputs.real") == 2**53


def test_non_finite_floats_are_values_like_others(twin: AlgTwin) -> None:
    twin.set("source.outputs.vec", [math.inf, -math.inf, math.nan])
    twin.set("source.outputs.single", -math.inf)
    twin.tick()
    assert math.isnan(twin.get_value("echo.outputs.sum")) and twin.get_value("echo.outputs.copy[1]") == -math.inf
    assert twin.get_value("source.outputs.single") == -math.inf


def test_requests_states_and_health_read_as_names(twin: AlgTwin) -> None:
    assert twin.get_value("echo.outputs.health") == "stale"
    twin.set("source.outputs.vec", [6.0, 0.0, 0.0])
    twin.tick()
    assert twin.get_value("echo.outputs.transition_request") == "tr_GO"
    assert twin.state() == "IDLE" and twin.get_value("machine.next_state") == "ACTIVE"
    twin.set("source.outputs.vec", [0.0, 0.0, 0.0])
    twin.tick()
    assert twin.get_value("echo.outputs.transition_request") == "" and twin.state() == "ACTIVE"
    assert twin.get_value("echo.outputs.health") == "nominal"
    twin.set_state("IDLE")
    assert twin.state() == "IDLE" and twin.get_value("echo.outputs.health") == "nominal"  # both states schedule it


def test_injected_overrun_degrades_and_counts(twin: AlgTwin) -> None:
    twin.overrun("echo")
    twin.tick()
    assert twin.get_value("echo.outputs.health") == "degraded" and twin.get_value("echo.counters.overruns") == 1
    twin.tick()
    assert twin.get_value("echo.outputs.health") == "nominal"


REFUSALS = [
    (("source.outputs.vex", 1.0), "has no such field; did you mean `source.outputs.vec`?"),
    (("source.outputs", 1.0), "is not a field but a group of fields: source.outputs.vec, "),
    (("source.outputs.vec[3]", 1.0), "index `3` is not in 0..2; the field is f64[3]"),
    (("source.outputs.vec[-1]", 1.0), "index `-1` is not in 0..2"),
    (("source.outputs.vec[0][0]", 1.0), "f64[3] takes at most 1 indices, got 2"),
    (("source.outputs.vec]", 1.0), "is not a path"),
    (("source.outputs.vec", [1.0, 2.0]), "f64[3] wanted, got a list of 2"),
    (("source.outputs.grid", [[1, 2, 3], [1, 2]]), "source.outputs.grid[1]: f32[3] wanted, got a list of 2"),
    (("source.outputs.vec", 1.0), "f64[3] wanted, got 1.0"),
    (("source.outputs.real", [1.0]), "one f64 wanted, got a list of 1"),
    (("source.outputs.real", "1.0"), "f64 wanted, got '1.0'"),
    (("source.outputs.real", True), "f64 wanted, got True"),
    (("source.outputs.real", None), "f64 wanted, got None"),
    (("source.outputs.real", 10**400), "is out of the range of f64"),
    (("source.outputs.real", 2**53 + 1), "9007199254740993 is not exactly representable in f64; write a float"),
    (("source.outputs.vec", [0, 0, -(2**60) - 1]), "-1152921504606846977 is not exactly representable in f64"),
    (("source.outputs.single", 2**24 + 1), "16777217 is not exactly representable in f32"),
    (("source.outputs.single", 1e39), "1e+39 is out of the range of f32"),
    (("source.outputs.small", 2**31), "2147483648 is out of the range of i32 (-2147483648 to 2147483647)"),
    (("source.outputs.word", -1), "-1 is out of the range of u32"),
    (("source.outputs.small", 1.0), "i32 wanted, got 1.0; write an integer"),
    (("source.outputs.small", True), "i32 wanted, got True"),
    (("source.outputs.flag", 1), "bool wanted, got 1; write True or False"),
    (("echo.parameters.fixed", 1.0), "frozen: the compiler folded this parameter's value into the code"),
    (("echo.outputs.health", "failed"), "read-only: instance `echo` computes it"),
    (("echo.outputs.transition_request", "GO"), "read-only: instance `echo` computes it"),
    (("machine.state", "IDLE"), "read-only; call set_state()"),
    (("machine.tick", 3), "read-only (machine)"),
    (("echo.counters.faults", 3), "read-only (counter)"),
]


@pytest.mark.parametrize(("call", "reason"), REFUSALS, ids=[f"{c[0]}={c[1]}"[:40] for c, _ in REFUSALS])
def test_refusals_say_why_and_change_nothing(twin: AlgTwin, call: tuple[str, Any], reason: str) -> None:
    before = twin.save()
    with pytest.raises(TwinError) as caught:
        twin.set(*call)
    assert reason in str(caught.value) and call[0].split("[")[0] in str(caught.value)
    assert twin.save() == before


def test_wrong_names_and_counts_are_refused(twin: AlgTwin) -> None:
    with pytest.raises(TwinError, match=r"`ACTIV` is not a state; did you mean `ACTIVE`\?; states: IDLE, ACTIVE"):
        twin.set_state("ACTIV")
    with pytest.raises(TwinError, match=r"`ehco` is not an instance; did you mean `echo`\?"):
        twin.overrun("ehco")
    with pytest.raises(TwinError, match="max_wcet_us"):
        twin.overrun("source")
    for n in (-1, 1.0, True, "1", 2**63, 2**64 + 1):
        with pytest.raises(TwinError, match="number of ticks"):
            twin.tick(n)  # type: ignore[arg-type]
    with pytest.raises(TwinError, match="is not a path"):
        twin.get_value("")


def test_discovery(twin: AlgTwin) -> None:
    assert [f.path for f in twin.fields("echo.parameters")] == ["echo.parameters.gain", "echo.parameters.fixed"]
    assert str(twin.describe("source.outputs.real")) == "source.outputs.real: f64 m/s (output)  # a speed"
    assert str(twin.describe("echo.inputs.vec")) == (
        "echo.inputs.vec: f64[3] (input, connected from source.outputs.vec)"
    )
    assert [c.name for c in twin.channels()] == ["imu.gyro", "imu.attitude", "level", "switch"]
    assert twin.instances()[1].max_wcet_us == 100
    assert [(t.source, t.target, t.request, t.guard_health) for t in twin.machine.transitions] == [
        ("IDLE", "ACTIVE", "GO", ()),
        ("ACTIVE", "IDLE", "STOP", ("nominal", "degraded")),
    ]


# ---- time -------------------------------------------------------------------------------------------------------------


def test_resume_runs_in_real_time_and_pause_stops_it(twin: AlgTwin) -> None:
    started = time.monotonic()
    twin.resume()
    twin.resume()  # a second one changes nothing
    assert twin.running
    with pytest.raises(TwinError, match=r"call pause\(\) before tick\(\)"):
        twin.tick()
    twin.set("source.outputs.real", 4.0)  # between ticks
    while twin.get_value("machine.tick") < 20:
        assert time.monotonic() - started < 30, "the twin does not advance"
        time.sleep(0.005)
    twin.pause()
    elapsed = time.monotonic() - started
    ticks = twin.get_value("machine.tick")
    # 100 Hz: never ahead of real time, whatever the load of this computer.
    assert 20 <= ticks <= elapsed * 100 + 1 and not twin.running
    time.sleep(0.05)
    assert twin.get_value("machine.tick") == ticks
    twin.pause()  # a second one changes nothing
    assert twin.tick() == ticks + 1


def test_a_computer_that_is_too_slow_loses_ticks_and_says_so(twin: AlgTwin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simclient.twin.alg_twin._MAX_LAG_NS", 10_000_000)  # one tick of this machine
    step = twin._run.step
    monkeypatch.setattr(twin._run, "step", lambda ticks: (time.sleep(0.05), step(ticks)))  # at 100 Hz, late every time
    started = time.monotonic()
    twin.resume()
    assert twin.ticks_skipped == 0
    while twin.ticks_skipped < 10:
        assert time.monotonic() - started < 30, "no tick is lost"
        time.sleep(0.005)
    twin.pause()
    done, elapsed = twin.get_value("machine.tick"), time.monotonic() - started
    assert 0 < done and done + twin.ticks_skipped <= elapsed * 100 + 1
    monkeypatch.undo()
    twin.resume()  # counts anew
    twin.pause()
    assert twin.ticks_skipped == 0


def test_ctrl_c_stops_a_long_run(probe: Path) -> None:
    code = (
        "import sys; from simclient import AlgTwin\n"
        "twin = AlgTwin.from_library(sys.argv[1]); print('ready', flush=True)\n"
        "try: twin.tick(2**62)\n"
        "except KeyboardInterrupt: print(twin.get_value('machine.tick') > 0 and twin.tick() > 1)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code, str(probe)], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None and running.stdout.readline() == "ready\n"
        time.sleep(0.5)
        running.send_signal(signal.SIGINT)
        try:
            assert running.communicate(timeout=60)[0] == "True\n"
        finally:
            running.kill()


def test_runs_again_after_a_pause_and_closes_while_running(probe: Path) -> None:
    twin = AlgTwin.from_library(probe)
    for _ in range(3):
        before = twin.get_value("machine.tick")
        twin.resume()
        deadline = time.monotonic() + 30
        while twin.get_value("machine.tick") == before:
            assert time.monotonic() < deadline
            time.sleep(0.002)
        twin.pause()
    twin.resume()
    twin.close()
    twin.close()
    for call in (twin.tick, twin.resume, twin.save, lambda: twin.get_value("machine.tick")):
        with pytest.raises(TwinError, match="closed"):
            call()  # type: ignore[operator]


# ---- checkpoints and isolation ----------------------------------------------------------------------------------------


def test_save_and_restore_repeat_the_future(twin: AlgTwin) -> None:
    twin.set("source.outputs.vec", [1.0, 2.0, 0.25])
    twin.tick(7)
    checkpoint = twin.save()
    twin.tick(5)
    later = twin.save()
    twin.set("echo.parameters.gain", 9.0)
    twin.tick(3)
    twin.restore(checkpoint)
    assert twin.get_value("machine.tick") == 7 and twin.get_value("echo.parameters.gain") == 2.0
    twin.tick(5)
    assert twin.save() == later


def test_foreign_and_damaged_checkpoints_are_refused(twin: AlgTwin, grown_probe: Path) -> None:
    checkpoint = twin.save()
    with pytest.raises(TwinError, match="not a checkpoint"):
        twin.restore(b"nonsense")
    with pytest.raises(TwinError, match="bytes"):
        twin.restore(checkpoint[:-1])
    with AlgTwin.from_library(grown_probe) as other:
        with pytest.raises(TwinError, match="another layout"):
            twin.restore(other.save())


def test_twins_do_not_touch_each_other(probe: Path) -> None:
    with AlgTwin.from_library(probe) as a, AlgTwin.from_library(probe) as b:
        a.set("source.outputs.vec", [3.0, 3.0, 3.0])
        a.tick(4)
        assert b.get_value("machine.tick") == 0 and b.get_value("source.outputs.vec") == [0.0, 0.0, 0.0]
        b.restore(a.save())
        assert b.save() == a.save()


# ---- opening ----------------------------------------------------------------------------------------------------------


def test_libraries_that_cannot_be_opened(probe: Path, tmp_path: Path) -> None:
    text = tmp_path / "text.so"
    text.write_text("not a library")
    for path, machine, reason in (
        (tmp_path / "absent.so", None, "no such machine library"),
        (text, None, "text.so"),
        (probe, "other", "other"),
    ):
        with pytest.raises(TwinError, match=reason):
            AlgTwin.from_library(path, machine)
    with AlgTwin.from_library(probe, "probe") as twin:
        assert twin.machine.name == "probe"


def test_a_missing_config_names_both_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TwinError) as caught:
        AlgTwin.from_config("nowhere.json")
    assert str(tmp_path / "nowhere.json") in str(caught.value)
    assert str(Path(__file__).parent / "nowhere.json") in str(caught.value)


def test_a_missing_config_is_named_once_where_both_places_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parent)
    with pytest.raises(TwinError) as caught:
        AlgTwin.from_config("nowhere.json")
    assert str(caught.value) == f"no such machine config: {Path(__file__).parent / 'nowhere.json'}"


def test_a_directory_is_not_a_config(tmp_path: Path) -> None:
    with pytest.raises(TwinError, match="a directory; name the machine's JSON file") as caught:
        AlgTwin.from_config(tmp_path)
    assert str(tmp_path) in str(caught.value)


def test_without_an_environment_it_says_what_to_do(probe: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(TwinError, match="fcsl_runtime.*setup.bash"):
        AlgTwin.from_library(probe)
    with pytest.raises(TwinError, match="fcsl_runtime.*setup.bash"):
        runtime_program("fcsl-fc")


def test_importing_simclient_pulls_in_nothing_heavy() -> None:
    heavy = ["rclpy", "rosbags", "rerun", "numpy", "matplotlib", "mcap", "yaml"]
    code = f"import sys, simclient; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# ---- the lander: what a user writes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
@pytest.mark.parametrize(("low", "climbing", "high"), [(12.0, 3.0, 41.0), (5.0, 4.0, 45.0)])
def test_lander_climbs_until_its_target(
    kind: type[AlgTwin], low: float, climbing: float, high: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    with kind.from_config("examples/lander/fc/lander_control.json") as twin:
        twin.pause()  # from here on only tick() moves the machine
        twin.set("sensors.outputs.pos_z", low)  # low and slow: keep climbing
        twin.set("sensors.outputs.vel_z", climbing)
        twin.tick()
        assert twin.state() == "ASCENT" and twin.get_value("ascent.outputs.throttle") > 0.5
        twin.set("sensors.outputs.pos_z", high)  # past the 40 m target
        twin.tick()
        assert twin.get_value("ascent.outputs.transition_request") == "tr_START_COAST"
        twin.tick()
        assert twin.state() == "COAST"


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
def test_config_is_found_beside_the_caller(
    kind: type[AlgTwin], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with kind.from_config("../../../examples/minimal/minimal.json") as twin:
        assert twin.machine.name == "minimal"


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
def test_compile_errors_are_the_compilers_own_text(kind: type[AlgTwin], tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text('{"tick_hz": 100,')
    with pytest.raises(TwinError, match=r"broken\.json:1:\d+: error\["):
        kind.from_config(tmp_path / "broken.json")
