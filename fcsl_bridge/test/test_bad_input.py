# SPDX-License-Identifier: Apache-2.0
"""Bad input is one clear message and exit status 1, never a traceback."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from bridge_harness import MACHINE, SIM, Domain

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.base.node_main import Option
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.loopback import loopback_environment
from fcsl_bridge.nodes import controller_node, sim_node, topic_count
from fcsl_compiler.base.packages import package_prefix

CONTROLLER, SIMULATOR = "controller_node", "sim_node"


@pytest.mark.parametrize(
    ("executable", "parameters", "message"),
    [
        (CONTROLLER, {}, "parameter `machine` is missing"),
        (CONTROLLER, {"machine": "lander/lander_contrl"}, "did you mean `lander/lander_control`?"),
        (CONTROLLER, {"machine": "lander"}, "write package/machine as in lander/lander_control"),
        (CONTROLLER, {"machine": "no/such.so"}, "no such library: no/such.so"),
        (CONTROLLER, {"machine": MACHINE, "recrod": "x"}, "unknown parameter `recrod`; did you mean `record`?"),
        (
            CONTROLLER,
            {"machine": MACHINE, "mode": "sometimes"},
            "`mode` takes lockstep, realtime, clock, got `sometimes`",
        ),
        (CONTROLLER, {"machine": MACHINE, "decimate": 0}, "`decimate` must be above zero, got 0"),
        (CONTROLLER, {"machine": MACHINE, "decimate": "often"}, "`decimate` takes a whole number n"),
        (CONTROLLER, {"machine": MACHINE, "record": "/no/such/folder/bag"}, "/no/such/folder"),
        (
            CONTROLLER,
            {"machine": MACHINE, "start_timeout_s": 0.5},
            "no simulator within 0.5 s: cannot connect to tcp:127.0.0.1:",
        ),
        (
            CONTROLLER,
            {"machine": MACHINE, "start_timeout_s": 0.5, "wait_for_subscribers": 1},
            "fewer than 1 subscribers within 0.5 s on /lander_control/",
        ),
        (CONTROLLER, {"machine": MACHINE, "wait_for_subscribers": -1}, "`wait_for_subscribers` must not be negative"),
        (SIMULATOR, {}, "parameter `sim` is missing"),
        (SIMULATOR, {"sim": "no/such.sim.json"}, "no/such.sim.json"),
        (SIMULATOR, {"sim": "package://no_such_package/x.sim.json"}, "package `no_such_package` is not installed"),
        (SIMULATOR, {"sim": SIM, "seed": -1}, "`seed` must not be negative"),
        (SIMULATOR, {"sim": SIM, "wait_for_subscribers": -1}, "`wait_for_subscribers` must not be negative, got -1"),
        (SIMULATOR, {"sim": SIM, "duration": 0.0}, "`duration` must be above zero"),
        (SIMULATOR, {"sim": SIM, "duration": 1e300}, "duration: 1e+300 s is more than 1e+09 s"),
        (SIMULATOR, {"sim": SIM, "duration": ".inf"}, "`duration` must be finite, got inf"),
        (SIMULATOR, {"sim": SIM, "timeout_s": ".nan"}, "`timeout_s` must be finite, got nan"),
        (SIMULATOR, {"sim": SIM, "duration": 0.005}, "duration: 0.005 s is not a whole number of ticks"),
        (
            SIMULATOR,
            {"sim": SIM, "start_timeout_s": 0.5},
            "no controller within 0.5 s on tcp:127.0.0.1:",
        ),
        ("topic_count", {"idle_s": -1.0}, "`idle_s` must be above zero"),
    ],
)
def test_bad_parameter(domain: Domain, executable: str, parameters: dict[str, Any], message: str) -> None:
    process = domain.start(executable, **parameters)
    assert process.finish() == 1
    # A controller's node is called like its machine, once that is known.
    assert (
        re.search(rf"({executable}: error|{executable}\]|lander_control\]): ", process.err) and message in process.err
    )


def test_bad_simulation(domain: Domain, tmp_path: Path) -> None:
    broken = tmp_path / "broken.sim.json"
    broken.write_text('{"controller": 1e}', encoding="utf-8")
    process = domain.start(SIMULATOR, sim=broken)
    assert process.finish() == 1
    assert f"{broken}:1:" in process.err


@pytest.mark.parametrize("executable", [CONTROLLER, SIMULATOR, "topic_count"])
def test_arguments_that_ros_does_not_take(domain: Domain, executable: str) -> None:
    process = domain.run([package_prefix("fcsl_bridge") / "lib/fcsl_bridge" / executable, "machine:=x"])
    assert process.finish() == 1
    assert (
        f"{executable}: error: unexpected argument `machine:=x`; parameters are given as --ros-args -p" in process.err
    )


@pytest.mark.parametrize("word", ["-h", "--help"])
@pytest.mark.parametrize(
    ("executable", "options"),
    [(CONTROLLER, controller_node.OPTIONS), (SIMULATOR, sim_node.OPTIONS), ("topic_count", topic_count.OPTIONS)],
)
def test_help(domain: Domain, executable: str, options: tuple[Option, ...], word: str) -> None:
    process = domain.run([package_prefix("fcsl_bridge") / "lib/fcsl_bridge" / executable, word])
    assert process.finish() == 0 and process.err == ""
    assert all(f"  {option.name} " in process.out and option.doc in process.out for option in options)


@pytest.mark.parametrize("word", ["--help", "--version"])
def test_help_that_nobody_reads(word: str) -> None:
    """As by `| head`: the pipe is closed before anything is written."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    node = [package_prefix("fcsl_bridge") / "lib/fcsl_bridge" / CONTROLLER, word]
    done = subprocess.run(node, stdout=write_end, stderr=subprocess.PIPE, text=True, check=False, timeout=60)
    os.close(write_end)
    assert done.stderr == "" and done.returncode == 1


def test_bad_ros_arguments(domain: Domain) -> None:
    process = domain.start(CONTROLLER, "-r", "__ns:=9/!", machine=MACHINE)
    assert process.finish() == 1 and "controller_node: error: ROS 2:" in process.err


def test_machine_index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    index = tmp_path / "share/ament_index/resource_index/fcsl_machines"
    index.mkdir(parents=True)
    (index / "craft__pilot").write_text("lib/craft/libx.so\n", encoding="utf-8")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(BridgeError, match="libx.so is missing; build package `craft` again"):
        find_machine("craft/pilot")
    library = tmp_path / "lib/craft/libx.so"
    library.parent.mkdir(parents=True)
    library.touch()
    assert find_machine("craft/pilot") == (library, "pilot")
    assert find_machine(str(library)) == (library, None)
    assert find_machine(f"{library}:pilot") == (library, "pilot")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(BridgeError, match="there are none: source install/setup.bash"):
        find_machine("craft/pilot")


@pytest.mark.parametrize(
    ("environment", "loopback"),
    [
        ({}, True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, False),
        ({"FASTRTPS_DEFAULT_PROFILES_FILE": "/my.xml"}, False),
        ({"FASTDDS_DEFAULT_PROFILES_FILE": "/my.xml"}, False),
    ],
)
def test_the_users_network_settings_win(environment: dict[str, str], loopback: bool) -> None:
    added = loopback_environment(environment)
    assert bool(added) == loopback
    if loopback:
        assert Path(added["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()


def test_sockets_are_bound_to_loopback(domain: Domain) -> None:
    """Every UDP socket of a waiting node is bound to 127.0.0.1, or to DDS' multicast group."""
    process = domain.start(CONTROLLER, machine=MACHINE)
    process.wait_for("waiting for a simulator")
    pid = process.process.pid
    inodes = {p.readlink().name.removeprefix("socket:[").rstrip("]") for p in Path(f"/proc/{pid}/fd").iterdir()}
    rows = [line.split() for line in Path(f"/proc/{pid}/net/udp").read_text(encoding="ascii").splitlines()[1:]]
    bound = {row[1].split(":")[0] for row in rows if row[9] in inodes}
    loopback, multicast = "0100007F", "0100FFEF"  # 127.0.0.1 and 239.255.0.1, as /proc shows them
    assert loopback in bound and bound <= {loopback, multicast}
