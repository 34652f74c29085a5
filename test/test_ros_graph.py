# SPDX-License-Identifier: Apache-2.0
"""`--ros`: a machine in a ROS 2 graph by zenoh-plugin-ros2dds, seen as the bridge sees it (docs/ros_graph.md).

Here a Zenoh session of Python stands for the bridge; `make interop` has the plugin itself.
"""

from __future__ import annotations

import contextlib
import json
import queue
import random
import re
import signal
import socket
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import zenoh
from ament_index_python.packages import get_package_share_directory
from lander.msg import LanderControlDescent
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from fcsl_msgs.msg import MachineState
from simclient.bag.bag import Bag

SIM = Path(__file__).resolve().parents[1] / "examples/lander/sim/lander.sim.json"
LIBRARY = Path(get_package_share_directory("lander")).parents[1] / "lib/lander/liblander_machines.so"
LONG_S = 60
HZ = 100
INSTANCES = ["sensors", "monitor", "filter", "ascent", "coast", "descent", "safe", "engine"]
TOKEN = re.compile(r"@/(\w+)/@ros2_lv/MP/([^/]+)/([^/]+)/:1:([01]):0,(\d+):typehash=(RIHS01_[0-9a-f]{64});")


def free_endpoint() -> str:
    """Below the ports of outgoing connections."""
    for port in random.SystemRandom().sample(range(20000, 32000), 100):
        with socket.socket() as found, contextlib.suppress(OSError):
            found.bind(("127.0.0.1", port))
            return f"tcp/127.0.0.1:{port}"
    raise AssertionError("no free port")


@contextlib.contextmanager
def started(*line: str | Path) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    process = subprocess.Popen([str(w) for w in line], stdout=pipe, stderr=pipe, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@contextlib.contextmanager
def bridge(endpoint: str) -> Iterator[zenoh.Session]:
    """It may begin before the program that listens."""
    config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("connect/timeout_ms", str(LONG_S * 1000))
    config.insert_json5("connect/retry", "{period_init_ms: 20, period_max_ms: 20}")
    with zenoh.open(config) as session:
        yield session


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def tokens(session: zenoh.Session) -> dict[str, tuple[str, str, str, str]]:
    """By topic: type, durability, depth, hash. All are of the session that listens."""
    found = [TOKEN.fullmatch(str(r.ok.key_expr)) for r in session.liveliness().get("@/*/@ros2_lv/**") if r.ok]
    (zid,) = {token[1] for token in found if token}
    assert zid in map(str, session.info.peers_zid())
    return {t[2].replace("§", "/"): (t[3].replace("§", "/"), t[4], t[5], t[6]) for t in found if t}


def installed_hash(kind: str) -> str:
    package, _, name = kind.split("/")
    known = json.loads((Path(get_package_share_directory(package)) / f"msg/{name}.json").read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in known["type_hashes"]}
    return str(hashes[kind])


def test_topics_of_a_simulation(tmp_path: Path) -> None:
    """Every message has the bytes that the bag has, of every tick from the first one on that was subscribed."""
    endpoint = free_endpoint()
    bag = tmp_path / "bag"
    options = ["--record", bag, "--ros", endpoint, "--namespace", "/r1/", "--speed", "2", "--duration", "4", "--json"]
    came: dict[str, list[bytes]] = defaultdict(list)
    late: queue.Queue[bytes] = queue.Queue()
    with started("fcsl-sim", "run", SIM, *options) as sim, bridge(endpoint) as session:
        declared = tokens(session)
        everything = session.declare_subscriber("**", lambda s: came[str(s.key_expr)].append(bytes(s.payload)))
        until(lambda: len(came["clock"]) > 20)
        history = HistoryConfig(detect_late_publishers=True, max_samples=1)
        heard = lambda s: late.put(bytes(s.payload))  # noqa: E731
        advanced = declare_advanced_subscriber(session, "r1/lander_control/state", heard, history=history)
        state = deserialize_message(late.get(timeout=LONG_S), MachineState)
        out, complaint = sim.communicate(timeout=LONG_S)
        advanced.undeclare()
        everything.undeclare()
    assert sim.returncode == 1, complaint  # it ends before it has landed
    assert (state.state, state.tick, state.header.stamp.sec) == ("ASCENT", 0, 0)
    assert json.loads(out)["ros"] == {"ticks": 4 * HZ, "dropped": 0}

    volatile = {"transitions": "100", **dict.fromkeys(INSTANCES, "2000")}
    wanted = {f"r1/lander_control/{name}": ("0", depth) for name, depth in volatile.items()}
    wanted |= {f"r1/lander_control/{name}": ("1", "1") for name in ("state", "health", "faults")}
    assert {topic: token[1:3] for topic, token in declared.items()} == wanted | {"clock": ("0", "2000")}
    assert {topic: token[3] for topic, token in declared.items()} == {
        topic: installed_hash(token[0]) for topic, token in declared.items()
    }

    recorded: dict[str, list[bytes]] = defaultdict(list)
    for topic, _, data in Bag(bag).messages():
        recorded[topic.removeprefix("/")].append(data)
    for topic in (f"r1/lander_control/{name}" for name in INSTANCES):
        assert len(came[topic]) > HZ and came[topic] == recorded[topic][-len(came[topic]) :], topic
    clocks = [deserialize_message(data, Clock).clock for data in came["clock"]]
    ticks = [(clock.sec * 10**9 + clock.nanosec) * HZ // 10**9 for clock in clocks]
    assert ticks == list(range(ticks[0], 4 * HZ))


def test_topics_of_a_flight_computer() -> None:
    """In real time stamps are of the system's clock, and there is no /clock."""
    endpoint = free_endpoint()
    came: queue.Queue[bytes] = queue.Queue()
    keys = set()

    def heard(sample: zenoh.Sample) -> None:
        keys.add(str(sample.key_expr))
        if str(sample.key_expr) == "lander_control/descent":
            came.put(bytes(sample.payload))

    begun_s = time.time()
    with (
        started("fcsl-fc", LIBRARY, "--machine", "lander_control", "--ros", endpoint) as fc,
        bridge(endpoint) as session,
    ):
        assert "clock" not in tokens(session)
        everything = session.declare_subscriber("**", heard)
        first, second = (deserialize_message(came.get(timeout=LONG_S), LanderControlDescent) for _ in range(2))
        fc.send_signal(signal.SIGTERM)
        said, complaint = fc.communicate(timeout=LONG_S)
        everything.undeclare()
    assert fc.returncode == 0, complaint
    assert re.search(r"ROS 2 topics \d+ ticks, 0 dropped", said)
    assert "clock" not in keys
    assert second.tick == first.tick + 1
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in (first, second)]
    assert begun_s < stamps[0] < stamps[1] < time.time()
