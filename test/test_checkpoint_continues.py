# SPDX-License-Identifier: Apache-2.0
"""A machine continues from its checkpoint file as if it had never stopped: after every tick the checkpoints, with every
field and the simulated hardware, are equal bit for bit. Tested with generated machines and the examples, under
generated host actions, compiled and in CPython."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from fcsl_compiler.driver.library import build_library
from simclient import AlgTwin, ProcessTwin, PyTwin, Twin, TwinError

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "fcsl_compiler/test"))

from fcsl_generator.campaign import generate  # noqa: E402
from fcsl_generator.machines import cases  # noqa: E402

EXAMPLES = {
    "lander": ROOT / "examples/lander/fc/lander_control.json",
    "minimal": ROOT / "examples/minimal/minimal.json",
    "ahrs": ROOT / "examples/ahrs/ahrs.json",
    "thermal_guard": ROOT / "examples/thermal_guard/thermal_guard.json",
}
#: Reads back its own writes: it needs the hardware in the checkpoint to continue.
LATCH = """
from fcsl_builtins import hw_read_adc, hw_read_gpio, hw_read_u32, hw_write_gpio, hw_write_u32


class Latch:
    outputs = {"lit": "bool", "counts": "u32", "word": "u32"}
    state = {"sum": "f64", "lost": "f64"}

    def execute(self):
        self.lit = not hw_read_gpio(2)
        hw_write_gpio(2, self.lit)
        self.counts = hw_read_adc(3)
        self.word = hw_read_u32(0x40000024)
        hw_write_u32(0x40000024, self.word ^ self.counts ^ 5)
        self.sum += f64(self.counts) * 0.8e-3 * f64(self.word) + (1.0 if self.lit else 0.5)
        self.lost = self.sum / 0.0 - self.sum / 0.0
"""
_GENERATED, _SEED = 5, 11
_REGISTER = 0x40000024


class Subject(NamedTuple):
    """A machine, possible host actions, and a function that opens a twin."""

    open_twin: Callable[[], Twin]
    actions: Sequence[tuple[str, Any]]


def act(twin: Twin, action: tuple[str, Any]) -> None:
    """Applies an action. A refused action is refused again after the restore."""
    kind, argument = action
    try:
        if kind == "hardware":
            bank, number, value = argument
            getattr(twin.hardware, bank)[number] = value
        elif kind == "sample":
            channel, age, stamp = argument
            path = next(c.field.path for c in twin.channels() if c.name == channel)
            twin.sample(channel, twin.get_value(path), age, stamp)
        elif kind in ("set", "force_health"):
            getattr(twin, kind)(*argument)
        else:
            getattr(twin, kind)(argument)
    except TwinError:
        pass


def of_case(case: Any) -> list[tuple[str, Any]]:
    """The host actions of a generated case."""
    names = {"overrun": "overrun", "fault": "fault", "force": "set_state", "attach": "attach"}
    found: list[tuple[str, Any]] = []
    for action in (a for tick in case.ticks for a in tick):
        if action.kind in names:
            found.append((names[action.kind], action.target))
        elif action.kind == "set":
            found.append(("set", (action.target, action.value)))
        elif action.kind == "health":
            found.append(("force_health", (action.target, action.value)))
        else:
            found.append(("sample", (action.target, *action.value)))
    return found


def of_machine(config: Path) -> list[tuple[str, Any]]:
    """Actions: finite and non-finite values, states, faults, samples, hardware."""
    with AlgTwin.from_config(config) as twin:
        found: list[tuple[str, Any]] = [("set_state", s) for s in twin.machine.states]
        found += [("fault", i.name) for i in twin.instances()]
        found += [("force_health", (i.name, health)) for i in twin.instances() for health in ("degraded", "failed")]
        for field in twin.fields():
            if field.writable and field.type in ("f64", "f32"):
                for value in (0.0, 1.5, -40.0, float("nan"), float("-inf")):
                    filled: Any = value
                    for extent in reversed(field.shape):
                        filled = [filled] * extent
                    found.append(("set", (field.path, filled)))
        sensors = [c.name for c in twin.channels() if c.direction == "sensor"]
    found += [action for c in sensors for action in (("attach", c), ("sample", (c, 0, 5)))]
    for bank, numbers in {"gpio": (0, 2, 3, 17), "adc": (0, 3), "registers": (0, _REGISTER)}.items():
        for number in numbers:
            found += [
                ("hardware", (bank, number, value)) for value in ((False, True) if bank == "gpio" else (0, 1, 999))
            ]
    return found


@pytest.fixture(scope="module")
def subjects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Subject]:
    """By name; those that end in `.py` run in CPython, those that end in `a process` run in the flight program."""
    folder = tmp_path_factory.mktemp("machines")
    (folder / "latch.py").write_text(LATCH)
    config: dict[str, Any] = {"tick_hz": 100, "initial_state": "A", "algorithms": {"Latch": {"source": "latch.py"}}}
    config |= {"instances": {"latch": {"algorithm": "Latch"}}, "states": {"A": {"schedule": {"latch": 100}}}}
    (folder / "latch.json").write_text(json.dumps(config))
    configs = {**EXAMPLES, "latch": folder / "latch.json"}
    found: dict[str, Subject] = {}
    for name, path in configs.items():
        actions = of_machine(path)
        found[name] = Subject(lambda path=path: AlgTwin.from_config(path), actions)  # type: ignore[misc]
        found[f"{name}.py"] = Subject(lambda path=path: PyTwin.from_config(path), actions)  # type: ignore[misc]
        found[f"{name}, a process"] = Subject(lambda path=path: ProcessTwin.from_config(path), actions)  # type: ignore[misc]
    made = generate(cases(), _GENERATED, _SEED)
    paths = [case.write(folder / f"g{n}", f"g{n}") for n, case in enumerate(made)]
    library = folder / "libgenerated.so"
    build_library(paths, library)
    for n, case in enumerate(made):
        open_one = lambda n=n: AlgTwin.from_library(library, f"g{n}")  # noqa: E731
        try:
            open_one().close()
        except TwinError:  # its start faults
            continue
        found[f"g{n}"] = Subject(open_one, of_case(case))  # type: ignore[arg-type]
    assert len(found) > 3 * len(configs) + 2
    return found


def differs_at(subject: Subject, history: Sequence[Sequence[tuple[str, Any]]], cut: int, carry: Any) -> int:
    """The first tick after `cut` at which a twin that was restored there differs from one that never stopped, or 0."""
    with ExitStack() as opened:
        steady, first, second = (opened.enter_context(subject.open_twin()) for _ in range(3))
        for twin, ticks in ((steady, history[:cut]), (first, history[:cut]), (second, history[cut:])):
            for actions in ticks:  # the restored twin has another history, which must not matter
                for action in actions:
                    act(twin, action)
                twin.tick()
        carry(first, second)
        first.close()
        if second.save() != steady.save():
            return cut
        for tick, actions in enumerate(history[cut:], cut + 1):
            for twin in (steady, second):
                for action in actions:
                    act(twin, action)
                twin.tick()
            if second.save() != steady.save():
                return tick
    return 0


def by_file(first: Twin, second: Twin) -> None:
    with tempfile.TemporaryDirectory() as folder:
        first.save_file(f"{folder}/checkpoint")
        second.restore_file(f"{folder}/checkpoint")


#: No shrinking: a failure names its subject and history, and each shrinking step runs three machines.
_SETTINGS = settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
    phases=[Phase.explicit, Phase.generate],
)


@pytest.mark.filterwarnings("ignore::simclient.OverwrittenWarning")
@_SETTINGS
@given(data=st.data())
def test_continuing_equals_never_having_stopped(subjects: dict[str, Subject], data: st.DataObject) -> None:
    subject = subjects[data.draw(st.sampled_from(sorted(subjects)))]
    action = st.sampled_from(subject.actions) if subject.actions else st.nothing()
    tick = st.lists(action, max_size=4) if subject.actions else st.just([])
    history = data.draw(st.lists(tick, min_size=2, max_size=24))
    assert differs_at(subject, history, data.draw(st.integers(1, len(history) - 1)), by_file) == 0


@pytest.mark.parametrize("name", ["latch", "latch.py", "latch, a process"])
def test_without_the_hardware_it_would_not(subjects: dict[str, Subject], name: str) -> None:
    """Control: the machine struct alone is not sufficient."""
    with subjects[name].open_twin() as steady, subjects[name].open_twin() as second:
        steady.tick(3)
        second._restore(steady._save())
        for twin in (steady, second):
            twin.tick()
        assert second._save() != steady._save()
        by_file(steady, second)
        for twin in (steady, second):
            twin.tick()
        assert second._save() == steady._save()


def test_a_bit_that_is_lost_is_found(subjects: dict[str, Subject]) -> None:
    """Control: the comparison finds a changed bit."""

    def carry(first: Twin, second: Twin) -> None:
        by_file(first, second)
        second.set("latch.state.sum", second.get_value("latch.state.sum") + 2.0**-40)  # type: ignore[operator]

    history: list[list[tuple[str, Any]]] = [
        [("hardware", ("adc", 3, 1500)), ("hardware", ("registers", _REGISTER, 7))],
        [],
        [],
    ]
    assert differs_at(subjects["latch"], history, 1, by_file) == 0
    assert differs_at(subjects["latch"], history, 1, carry) == 1


def test_compiled_and_cpython_take_each_others_files(subjects: dict[str, Subject], tmp_path: Path) -> None:
    with subjects["latch"].open_twin() as compiled, subjects["latch.py"].open_twin() as python:
        compiled.hardware.adc[3] = 125
        compiled.tick(5)
        compiled.save_file(tmp_path / "one")
        python.restore_file(tmp_path / "one")
        assert python.save() == compiled.save()
        compiled.tick(9)
        python.tick(9)
        python.save_file(tmp_path / "other")
        assert (tmp_path / "other").read_bytes() == compiled.save()
