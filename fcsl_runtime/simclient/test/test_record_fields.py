# SPDX-License-Identifier: Apache-2.0
"""Which fields a recording shows, as named fields of messages; and that a bag of few of them still reproduces the run."""

from __future__ import annotations

import fnmatch
import struct
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from native import ARMED, FIXTURE, GYRO, Refused, Run
from rosbags.highlevel import AnyReader

from simclient.bag import Bag, columns
from simclient.bag.writer import copy_of
from simclient.errors import BagError
from simclient.replay import replay
from simclient.run import open_run

ALWAYS = {"state", "transitions", "health", "faults", "record/checkpoint", "record/writes", "record/views"}


def record(bag: Path, fields: str | None = None, ticks: int = 20) -> Path:
    run = Run()
    run.record(bag, fields=fields)
    for k in range(ticks):
        run.set(GYRO, struct.pack("<3d", k, 0.5 * k, -k))
        if k == 7:
            run.set(ARMED, b"\1")
        run.step(1)
    run.call("fcsl_run_close")
    return bag


def topics(bag: Path) -> set[str]:
    return {name.removeprefix("/fixture/") for name in Bag(bag).topics}


def shown(bag: Path) -> set[str]:
    """Paths of the fields that a bag shows."""
    opened = Bag(bag)
    machine = opened.machine()
    prefixes = {topic: f"{instance}.outputs" for instance, topic in machine.outputs.items()}
    prefixes |= {topic: begin for begin, topic in machine.fields.items()}
    return {
        f"{prefix}.{leaf}"
        for topic, prefix in prefixes.items()
        for leaf in opened.fixed_layout(topic).leaves
        if leaf != "tick" and not leaf.startswith("header.")
    }


def integrals(ticks: int) -> list[float]:
    """`pilot.state.integral` after each tick of `record`, from the machine itself."""
    run = open_run(Path(FIXTURE), None)
    integral = run.machine.fields["pilot.state.integral"]
    seen = []
    for k in range(ticks):
        run.set(GYRO, 0, struct.pack("<3d", k, 0.5 * k, -k))
        if k == 7:
            run.set(ARMED, 0, b"\1")
        run.step(1)
        seen += struct.unpack("<d", run.read(integral.offset, integral.size))
    run.close()
    return seen


def test_inputs_and_outputs_by_default(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag")
    assert topics(bag) == ALWAYS | {"sensors", "pilot", "pilot/inputs"}
    taken, given = (columns(Bag(bag), path)[1].tolist() for path in ("pilot.inputs.gyro", "sensors.outputs.gyro"))
    assert taken[:8] == given[:8] and taken[8] == given[7]  # armed, the pilot runs in every other tick
    with AnyReader([bag]) as reader:
        definition = {c.topic: c.msgdef.data for c in reader.connections}["/fixture/pilot/inputs"]
    assert definition.startswith("std_msgs/Header header\nuint64 tick\nfloat64[3] gyro # [rad/s]\n")


def test_every_field(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", "*")
    chosen = {"pilot/inputs", "pilot/parameters", "pilot/state", "record/channels"}
    assert topics(bag) == ALWAYS | {"sensors", "pilot"} | chosen
    opened = Bag(bag)
    assert set(columns(opened, "pilot.parameters.gain")[1]) == {2.0}
    assert columns(opened, "channels.imu.gyro.valid")[1].tolist() == [True] * 20
    assert columns(opened, "pilot.state.integral")[1].tolist() == integrals(20)
    with AnyReader([bag]) as reader:
        (channels,) = [c for c in reader.connections if c.topic == "/fixture/record/channels"]
        message = next(reader.deserialize(raw, channels.msgtype) for _, _, raw in reader.messages([channels]))
    assert (message.tick, message.panel.armed.age_ticks, message.imu.gyro.stamp_ns) == (0, 0, 0)


def test_fields_that_are_not_there_are_named(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag")
    with pytest.raises(BagError, match=r"`pilot\.state\.integral`: recorded are .* and what begins with pilot\.inputs"):
        columns(Bag(bag), "pilot.state.integral")


@pytest.mark.parametrize("glob", ["pilot.imputs.*", "*.outputs.*,x*", "pilot", "fixture.pilot.*"])
def test_a_glob_that_matches_nothing_is_refused(glob: str, tmp_path: Path) -> None:
    run = Run()
    with pytest.raises(Refused, match="no field matches"):
        run.record(tmp_path / "bag", fields=glob)
    assert not (tmp_path / "bag").exists()
    run.call("fcsl_run_close")


def altered(bag: Path, topic: str, target: Path) -> Path:
    """A copy whose last message of `topic` has another last byte: the highest of a f64."""
    opened = Bag(bag)
    last = max(n for n, (name, _, _) in enumerate(opened.messages()) if name == topic)
    with copy_of(opened, target, opened.topics) as copy:
        for n, (name, log_ns, data) in enumerate(opened.messages()):
            copy.write(name, log_ns, data[:-1] + bytes([data[-1] ^ 1]) if n == last else data)
    return target


@pytest.mark.parametrize("fields", ["pilot.outputs.force", "", "pilot.outputs.force,*.state.*", "*"])
def test_few_fields_still_reproduce(fields: str, tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", fields)
    verdict = replay(bag, library=FIXTURE)
    assert verdict.identical and verdict.ticks == 20, verdict
    left_out = [note for note in verdict.notes if "has no outputs of" in note]
    assert bool(left_out) == (fields != "*")
    if fields.startswith("pilot"):
        assert Bag(bag).topics["/fixture/pilot"].type == "fcsl_runtime_fields/msg/FixturePilotOutputs"
        # Control: what is recorded is compared.
        verdict = replay(altered(bag, "/fixture/pilot", tmp_path / "altered"), library=FIXTURE)
        assert verdict.divergence is not None and verdict.divergence.path == "pilot.outputs.force"


def test_changes_are_told_whatever_is_chosen(tmp_path: Path) -> None:
    """Topics of states, transitions, healths and faults do not depend on the fields of a recording."""

    def told(fields: str) -> list[tuple[str, int, bytes]]:
        run = Run()
        run.record(tmp_path / f"bag{len(fields)}", fields=fields)
        for k in range(40):
            run.set(ARMED, b"\1" if k % 20 > 4 else b"\0")
            if k in (10, 20):
                run.call("fcsl_run_inject_fault" if k == 10 else "fcsl_run_inject_overrun", 1)
            run.step(1)
        run.call("fcsl_run_close")
        bag = Bag(tmp_path / f"bag{len(fields)}")
        names = {f"/fixture/{name}" for name in ("state", "transitions", "health", "faults")}
        return sorted((name, ns, bytes(data)) for name, ns, data in bag.messages(names))

    everything = told("*")
    counts = {name: sum(topic == f"/fixture/{name}" for topic, _, _ in everything) for name in ("health", "faults")}
    assert counts["health"] > 4 and counts["faults"] > 2
    assert told("sensors.outputs.armed") == everything and told("") == everything


def test_what_is_not_chosen_costs_nothing(tmp_path: Path) -> None:
    sizes = [sum(f.stat().st_size for f in record(tmp_path / f"bag{n}", fields, 5000).iterdir())
             for n, fields in enumerate(("", "*"))]  # fmt: skip
    assert sizes[0] < sizes[1] / 2


PATHS = [f for f in open_run(Path(FIXTURE), None).machine.fields]
#: What messages are made of: `machine.*` and counters have topics of their own.
CHOOSABLE = {p for p in PATHS if p.startswith(("channels.", "pilot.", "sensors.")) and ".counters." not in p}


@st.composite
def globs(draw: st.DrawFn) -> str:
    """A path in which pieces gave way to wildcards."""
    path = draw(st.sampled_from(PATHS))
    begin = draw(st.integers(0, len(path)))
    end = draw(st.integers(begin, len(path)))
    return path[:begin] + draw(st.sampled_from(["*", "?", "**", "*?", ""])) + path[end:]


@settings(max_examples=40)
@given(patterns=st.lists(globs().filter(bool), min_size=1, max_size=3))
def test_globs_are_those_of_the_shell(patterns: list[str]) -> None:
    """An independent matcher chooses the same fields; it knows brackets, too, which no path here has."""
    expected = {p for p in PATHS if any(fnmatch.fnmatchcase(p, glob) for glob in patterns)}
    hopeless = [glob for glob in patterns if not fnmatch.filter(PATHS, glob)]
    with tempfile.TemporaryDirectory() as name:
        if hopeless:
            with pytest.raises(Refused, match="matches"):
                record(Path(name) / "bag", ",".join(patterns), 1)
            return
        found = shown(record(Path(name) / "bag", ",".join(patterns), 1))
    # The interface of a whole instance leaves out a request that its algorithm never makes.
    assert found | {"sensors.outputs.transition_request"} >= expected & CHOOSABLE >= found
