# SPDX-License-Identifier: Apache-2.0
"""A machine's parameters are ROS 2 parameters: described, set between ticks, recorded, and effective."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest
import rig
from bridge_harness import Domain, Process
from controller_client import ACTIVATE, CLEANUP, CONFIGURE, ControllerClient

from fcsl_bridge.nodes.controller_node import OPTIONS
from fcsl_msgs.srv import Restore, Save
from simclient import AlgTwin, ProcessTwin
from simclient.bag import Bag
from simclient.replay import replay


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"))


def start(domain: Domain, library: Path, **parameters: Any) -> tuple[Process, ControllerClient]:
    process = domain.start("controller_node", machine=library, mode="realtime", checkpoints=domain.folder, **parameters)
    return process, ControllerClient(domain.listener())


def f32(value: float) -> float:
    return float(struct.unpack("=f", struct.pack("=f", value))[0])


def test_names_values_and_descriptions(domain: Domain, library: Path) -> None:
    _, client = start(domain, library)
    names = [name for name in client.names() if name.startswith("pilot.")]
    assert names == [f"pilot.{name}" for name in rig.PARAMETERS]
    for name, value in rig.PARAMETERS.items():
        flat = [v for row in value for v in row] if name == "table" else value
        assert client.get(f"pilot.{name}") == flat, name
    gain = client.describe("pilot.gain")
    assert gain.description == "torque for each radian [N/rad]" and not gain.read_only
    (span,) = gain.floating_point_range
    assert (span.from_value, span.to_value, span.step) == (0.0, 10.0, 0.0)
    (span,) = client.describe("pilot.steps").integer_range
    assert (span.from_value, span.to_value, span.step) == (-5, 5, 0)
    (span,) = client.describe("pilot.large").integer_range
    assert (span.from_value, span.to_value) == (0, 2**63 - 1)
    assert "f64[3]; each in -1..1" in client.describe("pilot.weights").additional_constraints
    said = client.describe("pilot.least").additional_constraints
    assert said == "Health; one of 'nominal', 'degraded', 'failed', 'stale'"
    said = client.describe("pilot.plan").additional_constraints
    assert said == "TransitionRequest[2]; one of '', 'tr_LAND', 'tr_HOLD'"
    assert client.describe("pilot.shape").read_only


#: Name, value to set, value that `get` then returns.
VALUES = [
    ("gain", 3, 3.0),
    ("gain", 10.0, 10.0),
    ("limit", -3.4e38, f32(-3.4e38)),
    ("limit", 0.1, f32(0.1)),
    ("steps", -5, -5),
    ("large", 2**63 - 1, 2**63 - 1),
    ("armed", False, False),
    ("weights", [1, 0, -1], [1.0, 0.0, -1.0]),
    ("weights", [-1.0, 0.1, 1.0], [-1.0, 0.1, 1.0]),
    ("masks", [False, True], [False, True]),
    ("table", [9, 8, 7, 6], [9, 8, 7, 6]),
    ("least", "failed", "failed"),
    ("on_done", "", ""),
    ("on_done", "tr_LAND", "tr_LAND"),
    ("on_done", "LAND", "tr_LAND"),
    ("plan", ["tr_HOLD", ""], ["tr_HOLD", ""]),
]


def check_memory(client: ControllerClient, library: Path, file: Path) -> None:
    """Checks with a checkpoint that the machine has the last of VALUES for each name."""
    held = client.call(Save, "save", file=file.name)
    assert held.success, held.message
    with AlgTwin.from_library(library) as twin:
        twin.restore(file.read_bytes())
        for name, shown in {name: shown for name, _, shown in VALUES}.items():
            found = twin.get_value(f"pilot.parameters.{name}")
            assert ([v for row in found for v in row] if name == "table" else found) == shown, name


def test_what_is_set_is_in_force(domain: Domain, library: Path) -> None:
    _, client = start(domain, library)
    for name, value, shown in VALUES:
        result = client.set(**{f"pilot__{name}": value})
        assert result.successful, result.reason
        assert client.get(f"pilot.{name}") == shown
    check_memory(client, library, domain.folder / "checkpoint")


def test_what_is_given_at_the_start_is_in_force(domain: Domain, library: Path) -> None:
    given = {f"pilot.{n}": str(v).replace("True", "true").replace("False", "false") for n, v, _ in VALUES}
    _, client = start(domain, library, **given)
    for name, shown in {name: shown for name, _, shown in VALUES}.items():
        assert client.get(f"pilot.{name}") == shown
    check_memory(client, library, domain.folder / "checkpoint")


def test_what_is_refused_changes_nothing(domain: Domain, library: Path) -> None:
    _, client = start(domain, library)
    before = {name: client.get(f"pilot.{name}") for name in rig.PARAMETERS}
    for name, value, reason in [
        ("gain", 10.5, "out of range"),
        ("gain", 10.000001, "10.000001 is not in 0..10"),  # rclpy's own check would accept it
        ("gain", math.nan, "out of range"),
        ("gain", "much", "Wrong parameter type"),
        ("steps", 6, "out of range"),
        ("steps", 1.5, "Wrong parameter type"),
        ("large", -1, "out of range"),
        ("limit", 1e39, "out of the range of f32"),
        ("limit", math.nan, "pilot.limit: nan is not finite"),
        ("limit", math.inf, "pilot.limit: inf is not finite"),
        ("offsets", [0.0, -math.inf], "pilot.offsets: -inf is not finite"),
        ("weights", [0.0, 0.0, 1.5], "1.5 is not in -1..1"),
        ("weights", [0.0, math.nan, 0.0], "nan is not in -1..1"),
        ("weights", [0.0, 0.0], "f64[3] wanted, got a list of 2"),
        ("least", "fatal", "Health wanted, got 'fatal'"),
        ("least", 2, "Wrong parameter type"),
        ("on_done", "FLY", "TransitionRequest wanted, got 'FLY'"),
        ("plan", ["tr_LAND"], "TransitionRequest[2] wanted, got a list of 1"),
        ("plan", ["tr_LAND", "tr_FLY"], "got 'tr_FLY'"),
        ("shape", 1.0, "read-only"),
    ]:
        result = client.set(**{f"pilot__{name}": value})
        assert not result.successful and reason in result.reason, (name, value, result)
    for several in ({"gain": 5.0, "steps": 9}, {"steps": 1, "weights": [2.0, 0.0, 0.0]}, {"gain": 5.0, "shape": 0.0}):
        assert not client.set_atomically(**{f"pilot__{name}": value for name, value in several.items()}).successful
    assert {name: client.get(f"pilot.{name}") for name in rig.PARAMETERS} == before


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pilot.gian": 1.0}, "machine `rig` has no parameter `pilot.gian`; did you mean `pilot.gain`?"),
        ({"nobody.there": 1.0}, "machine `rig` has no parameter `nobody.there`"),
        ({"pilot.gain": 11.0}, "`pilot.gain` lies in [0, 10]"),
        ({"pilot.limit": ".nan"}, "`pilot.limit`: expected a finite number"),
        ({"pilot.shape": 1.0}, "frozen: the compiler folded its value into the code"),
        ({"pilot.gain": "much"}, "`pilot.gain`: expected a finite number"),
        ({"pilot.weights": "[0.0, 1.0]"}, "`pilot.weights`: expected lists nested as its shape"),
    ],
)
def test_what_is_given_at_the_start_is_checked(
    domain: Domain, library: Path, given: dict[str, Any], message: str
) -> None:
    process = domain.start("controller_node", machine=library, mode="realtime", **given)
    assert process.finish() == 1
    assert message in process.err


def test_writes_are_in_the_bag_and_replay(domain: Domain, library: Path) -> None:
    bag = domain.folder / "bag"
    process, client = start(domain, library, record=bag, **{"pilot.gain": 2.0})
    for step in range(5):
        several = {"pilot__gain": float(step), "pilot__steps": step - 2, "pilot__weights": [0.1 * step] * 3}
        assert client.set_atomically(**several).successful
    assert not client.set_atomically(pilot__gain=9.0, pilot__steps=9).successful
    client.change(CLEANUP)
    process.signal(2)
    assert process.finish() == 0
    writes = [
        (message.tick, message.path)
        for topic, _, data in Bag(bag).messages()
        if topic.endswith("/record/writes")
        and (message := Bag(bag).decode_own(topic, data, ("tick", "kind", "path", "element", "data"))).kind == 0
    ]
    by_tick: dict[int, list[str]] = {}
    for tick, path in writes:
        by_tick.setdefault(tick, []).append(path)
    assert len(by_tick) == 5, "each request takes effect at one tick"
    wanted = {f"pilot.parameters.{name}" for name in ("gain", "steps", "weights")}
    assert all(set(paths) <= wanted for paths in by_tick.values())
    verdict = replay(bag, library=str(library))
    assert verdict.identical, verdict


def test_what_get_says_after_a_restore(domain: Domain, library: Path) -> None:
    _, client = start(domain, library, allow_set_state=True)
    file = "checkpoint"
    assert client.set(pilot__limit=0.1).successful and client.set(pilot__weights=[0.5, 0.5, 0.5]).successful
    assert client.call(Save, "save", file=file).success
    assert client.set(pilot__limit=7.0).successful and client.set(pilot__armed=False).successful
    assert client.call(Restore, "restore", file=file).success
    assert client.get("pilot.limit") == f32(0.1)
    assert client.get("pilot.armed") is True and client.get("pilot.weights") == [0.5, 0.5, 0.5]


def test_a_file_that_fcsl_var_saves(domain: Domain, library: Path) -> None:
    """Tuned on the flight program, flown with by the node."""
    values = {
        "gain": 3.0,
        "limit": f32(0.1),
        "weights": [1e-9, 0.0, -1.0],
        "table": [9, 8, 7, 6],
        "armed": False,
        "least": "failed",
        "on_done": "tr_LAND",
    }
    file = domain.folder / "tuned.yaml"
    with ProcessTwin.from_library(library) as twin:
        shaped = values | {"table": [[9, 8], [7, 6]]}
        twin.set_many({f"pilot.parameters.{name}": value for name, value in shaped.items()})
        file.write_text(twin._client.parameters())
    assert file.read_text().count("\n    pilot.") == len(values)
    domain.start("controller_node", "--params-file", str(file), machine=library, mode="realtime")
    client = ControllerClient(domain.listener())
    assert {name: client.get(f"pilot.{name}") for name in values} == values
    assert client.get("pilot.steps") == rig.PARAMETERS["steps"]


def test_parameters_come_and_go_with_the_configuration(domain: Domain, library: Path) -> None:
    """Each configure begins with the machine's values and those given at the start."""
    _, client = start(domain, library, autostart=False, **{"pilot.gain": 2})
    assert not any("." in name for name in client.names())
    for _ in range(2):
        assert client.change(CONFIGURE)
        assert client.get("pilot.gain") == 2.0 and client.get("pilot.steps") == 2
        assert client.set(pilot__gain=3.0).successful and client.set(pilot__steps=3).successful
        assert client.change(ACTIVATE) and client.get("pilot.gain") == 3.0
        assert client.change(4) and client.change(CLEANUP)
        assert not any("." in name for name in client.names())


def test_the_nodes_own_parameters_hold_from_its_start(domain: Domain, library: Path) -> None:
    """Callers of the node's services cannot load code, write a bag, or gain permissions."""
    _, client = start(domain, library, autostart=False)
    names = [option.name for option in OPTIONS if option.name != "tf"]  # it has no value where none was given
    given = {name: client.get(name) for name in names}
    for name, value in given.items():
        result = client.set(**{name: value})
        assert not result.successful and "read-only" in result.reason, name
    assert not client.set_atomically(machine="/tmp/other.so").successful
    assert {name: client.get(name) for name in names} == given
