# SPDX-License-Identifier: Apache-2.0
"""`--ros`: a machine in a ROS 2 graph by zenoh-plugin-ros2dds or rmw_zenoh, seen as these see it (docs/reference/transports.md).

Here Zenoh sessions of Python stand for the bridge, and for the router and a node of rmw_zenoh; `make interop` has the plugin
itself.
"""

from __future__ import annotations

import contextlib
import json
import queue
import re
import signal
import struct
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar, cast

import pytest
import zenoh
from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped, TwistStamped
from lander.msg import LanderControlDescent
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from zenoh.ext import AdvancedSubscriber, HistoryConfig, declare_advanced_subscriber

from fcsl_msgs.msg import Event, MachineState
from simclient import VarClient
from simclient.bag.bag import Bag
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint

ROOT = Path(__file__).resolve().parents[1]
SIM = ROOT / "examples/lander/sim/lander.sim.json"
ECHO = ROOT / "scripts/interop/machine/echo.json"
LIBRARY = Path(get_package_share_directory("lander")).parents[1] / "lib/lander/liblander_machines.so"
Message = TypeVar("Message")
LONG_S = 60
HZ = 100
INSTANCES = ["sensors", "monitor", "filter", "ascent", "coast", "descent", "safe", "engine"]
TOKEN = re.compile(r"@/(\w+)/@ros2_lv/(M[PS])/([^/]+)/([^/]+)/:([01]:[01]:0,\d+):typehash=(RIHS01_[0-9a-f]{64});")
#: Reliable or not, transient local or not, keep last, depth.
STREAM, EVENT, LATCHED, COMMAND, SENSOR = "1:0:0,2000", "1:0:0,100", "1:1:0,1", "1:0:0,10", "0:0:0,10"


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
    config.insert_json5("connect/endpoints", json.dumps([zenoh_locator(endpoint)]))
    config.insert_json5("connect/timeout_ms", str(LONG_S * 1000))
    config.insert_json5("connect/retry", "{period_init_ms: 20, period_max_ms: 20}")
    with zenoh.open(config) as session:
        yield session


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def tokens(session: zenoh.Session) -> dict[str, tuple[str, str]]:
    """Kind and quality of service by topic. All are of the session that listens, and their hashes those of the installed types.
    Services are left out: test_ros_services.py."""
    announced = [str(reply.ok.key_expr) for reply in session.liveliness().get("@/*/@ros2_lv/**") if reply.ok]
    found = [TOKEN.fullmatch(key) for key in announced if "/SS/" not in key]
    (zid,) = {token[1] for token in found if token}
    assert zid in map(str, session.info.peers_zid())
    for token in found:
        assert token and token[6] == installed_hash(token[4].replace("§", "/"))
    return {token[3].replace("§", "/"): (token[2], token[5]) for token in found if token}


def subscribe_latched(session: zenoh.Session, key: str, came: queue.Queue[bytes]) -> AdvancedSubscriber[Any]:
    """As the bridge subscribes to a transient local topic: what was sent before the subscription is known is asked for."""
    history = HistoryConfig(detect_late_publishers=True, max_samples=1)
    return declare_advanced_subscriber(session, key, lambda s: came.put(bytes(s.payload)), history=history)


def installed_hash(kind: str) -> str:
    package, _, name = kind.split("/")
    known = json.loads((Path(get_package_share_directory(package)) / f"msg/{name}.json").read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in known["type_hashes"]}
    return str(hashes[kind])


def clock_tick(data: bytes) -> int:
    clock = deserialize_message(data, Clock).clock
    return int((clock.sec * 10**9 + clock.nanosec) * HZ // 10**9)


def test_topics_of_a_simulation(tmp_path: Path) -> None:
    """Every message has the bytes that the bag has, of each tick from the first one on that was subscribed. The last ones may be
    missing: Zenoh ends a session ahead of what waits to be sent."""
    endpoint = free_endpoint()
    bag = tmp_path / "bag"
    options = ["--record", bag, "--ros", endpoint, "--namespace", "/r1/", "--speed", "2", "--duration", "4", "--json"]
    came: dict[str, list[bytes]] = defaultdict(list)
    late: queue.Queue[bytes] = queue.Queue()
    with started("fcsl-sim", "run", SIM, *options) as sim, bridge(endpoint) as session:
        declared = tokens(session)
        everything = session.declare_subscriber("**", lambda s: came[str(s.key_expr)].append(bytes(s.payload)))
        until(lambda: len(came["clock"]) > 20)
        latched = subscribe_latched(session, "r1/lander_control/state", late)
        state = deserialize_message(late.get(timeout=LONG_S), MachineState)
        out, complaint = sim.communicate(timeout=LONG_S)
        latched.undeclare()
        everything.undeclare()
    assert sim.returncode == 1, complaint  # it ends before it has landed
    assert (state.state, state.tick, state.header.stamp.sec) == ("ASCENT", 0, 0)
    assert json.loads(out)["ros"] == {"ticks": 4 * HZ, "dropped": 0, "refused": 0}

    wanted = {"transitions": EVENT, **dict.fromkeys(INSTANCES, STREAM)}
    wanted |= dict.fromkeys(("state", "health", "faults"), LATCHED)
    of_machine = {f"r1/lander_control/{name}": ("MP", quality) for name, quality in wanted.items()}
    assert declared == of_machine | {"clock": ("MP", STREAM)}

    recorded: dict[str, list[bytes]] = defaultdict(list)
    for topic, _, data in Bag(bag).messages():
        recorded[topic.removeprefix("/")].append(data)
    for topic in (f"r1/lander_control/{name}" for name in INSTANCES):
        first = recorded[topic].index(came[topic][0])
        assert len(came[topic]) > HZ and came[topic] == recorded[topic][first : first + len(came[topic])], topic
    ticks = [clock_tick(data) for data in came["clock"]]
    assert ticks == list(range(ticks[0], ticks[0] + len(ticks)))


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
    assert re.search(r"ROS 2 topics \d+ ticks, 0 dropped, 0 messages refused", said)
    assert "clock" not in keys
    assert second.tick == first.tick + 1
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in (first, second)]
    assert begun_s < stamps[0] < stamps[1] < time.time()


DOMAIN = 7
#: Of an endpoint: session, number in its node, kind, namespace, node, topic, type, hash, quality of service.
NODE_TOKEN = re.compile(rf"@ros2_lv/{DOMAIN}/(\w+)/0/0/NN/%/([^/]+)/([^/]+)")
RMW_TOKEN = re.compile(
    rf"@ros2_lv/{DOMAIN}/(\w+)/0/(\d+)/(M[PS])/%/([^/]+)/([^/]+)/([^/]+)/([^/]+)/(RIHS01_[0-9a-f]{{64}})/([^/]+)"
)


@contextlib.contextmanager
def node_of_rmw_zenoh(endpoint: str) -> Iterator[zenoh.Session]:
    """A session behind a router that listens there."""
    at = json.dumps([zenoh_locator(endpoint)])
    quiet = "scouting: {multicast: {enabled: false}, gossip: {enabled: false}}"
    router = zenoh.Config.from_json5(f'{{mode: "router", listen: {{endpoints: {at}}}, {quiet}}}')
    node = zenoh.Config.from_json5(f'{{mode: "client", connect: {{endpoints: {at}}}, {quiet}}}')
    with zenoh.open(router), zenoh.open(node) as session:
        yield session


def rmw_key(topic: str, kind: str) -> str:
    package, _, name = kind.split("/")
    return f"{DOMAIN}/{topic}/{package}::msg::dds_::{name}_/{installed_hash(kind)}"


def attached(sample: zenoh.Sample) -> tuple[int, int, bytes]:
    """Number, time and GID, as rmw_zenoh requires them."""
    number, time_ns, size, gid = struct.unpack("<qqB16s", bytes(sample.attachment or b""))
    assert size == 16
    return number, time_ns, gid


def test_topics_among_nodes_of_rmw_zenoh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    endpoint = free_endpoint()
    options = ["--ros", f"rmw_zenoh:{zenoh_locator(endpoint)}", "--namespace", "/r1/", "--speed", "0.2"]
    came: queue.Queue[zenoh.Sample] = queue.Queue()
    latched: queue.Queue[zenoh.Sample] = queue.Queue()
    descent = rmw_key("r1/lander_control/descent", "lander/msg/LanderControlDescent")
    with node_of_rmw_zenoh(endpoint) as node, started("fcsl-sim", "run", SIM, *options) as sim:
        subscriber = node.declare_subscriber(descent, came.put)
        samples = [came.get(timeout=LONG_S) for _ in range(10)]
        seen = [str(reply.ok.key_expr) for reply in node.liveliness().get(f"@ros2_lv/{DOMAIN}/**") if reply.ok]
        history = HistoryConfig(detect_late_publishers=True, max_samples=1)
        state_key = rmw_key("r1/lander_control/state", "fcsl_msgs/msg/MachineState")
        late = declare_advanced_subscriber(node, state_key, latched.put, history=history)
        state = latched.get(timeout=LONG_S)
        late.undeclare()
        subscriber.undeclare()
        sim.send_signal(signal.SIGTERM)
        _, complaint = sim.communicate(timeout=LONG_S)
    assert sim.returncode == 128 + signal.SIGTERM, complaint

    messages = [read(sample, LanderControlDescent) for sample in samples]
    assert [m.tick for m in messages] == list(range(messages[0].tick, messages[0].tick + 10))
    numbers, times, gids = zip(*map(attached, samples), strict=True)
    assert list(numbers) == list(range(1, 11)) and list(times) == sorted(times)
    assert abs(times[0] - time.time_ns()) < LONG_S * 10**9
    assert read(state, MachineState).state == "ASCENT" and attached(state)[0] == 1
    assert len({*gids, attached(state)[2]}) == 2, "one for each publisher"

    (alone,) = [found for token in seen if (found := NODE_TOKEN.fullmatch(token))]
    assert alone[2] == "%r1" and alone[3] == "lander_control"
    endpoints = [found for token in seen if (found := RMW_TOKEN.fullmatch(token))]
    assert len(endpoints) == len(seen) - 1 and {found[1] for found in endpoints} == {alone[1]}
    assert sorted(int(found[2]) for found in endpoints) == list(range(1, len(endpoints) + 1))
    assert {found[3] for found in endpoints} == {"MP"}
    topics = {found[6].replace("%", "/"): found for found in endpoints}
    wanted = {"transitions", "state", "health", "faults", *INSTANCES}
    assert set(topics) == {"/clock"} | {f"/r1/lander_control/{name}" for name in wanted}
    assert topics["/r1/lander_control/state"][9] == ":1:,1:,:,:,,"  # transient local, depth 1
    assert topics["/clock"][9] == ":2:,2000:,:,:,,"
    for found in endpoints:
        package, name = found[7].split("::msg::dds_::")
        assert found[8] == installed_hash(f"{package}/msg/{name.removesuffix('_')}")


def test_a_hal_among_nodes_of_rmw_zenoh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message without an attachment is taken, too: the machine needs nothing of it."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    endpoint = free_endpoint()
    subprocess.run(["fcslc", "build", ECHO, "-o", tmp_path], check=True)
    options = ["--hal", f"ros:rmw_zenoh:{zenoh_locator(endpoint)}", "--namespace", "r1"]
    commands: queue.Queue[zenoh.Sample] = queue.Queue()
    sensor = rmw_key("r1/imu/data", "sensor_msgs/msg/Imu")
    with node_of_rmw_zenoh(endpoint) as node, started("fcsl-fc", tmp_path / "libecho.so", *options) as fc:
        subscriber = node.declare_subscriber(rmw_key("r1/cmd_vel", "geometry_msgs/msg/TwistStamped"), commands.put)
        sample = commands.get(timeout=LONG_S)
        for attachment in (struct.pack("<qqB16s", 1, time.time_ns(), 16, bytes(16)), None):
            rate = read(sample, TwistStamped).twist.linear.x + 1.0
            while read(sample, TwistStamped).twist.linear.x != rate:
                node.put(sensor, imu(rate, time.time_ns()), attachment=attachment)
                sample = commands.get(timeout=LONG_S)
        assert attached(sample)[0] > 1
        subscriber.undeclare()
        fc.send_signal(signal.SIGTERM)
        _, complaint = fc.communicate(timeout=LONG_S)
    assert fc.returncode == 0, complaint


def test_without_a_router_of_rmw_zenoh(monkeypatch: pytest.MonkeyPatch) -> None:
    line = ["fcsl-fc", LIBRARY, "--machine", "lander_control", "--ros", f"rmw_zenoh:{zenoh_locator(free_endpoint())}"]
    found = subprocess.run(line, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert found.returncode == 1 and "no ROS 2 graph: cannot connect to tcp/127.0.0.1:" in found.stderr
    assert "`ros2 run rmw_zenoh_cpp rmw_zenohd` starts the router" in found.stderr
    monkeypatch.setenv("ROS_DOMAIN_ID", "233")
    found = subprocess.run(line, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert found.returncode == 1 and "ROS_DOMAIN_ID is '233'; it is a number from 0 to 232" in found.stderr


def test_a_command_is_told_while_the_flight_computer_is_paused(tmp_path: Path) -> None:
    endpoint, address = free_endpoint(), tmp_path / "socket"
    came: queue.Queue[bytes] = queue.Queue()
    line = [LIBRARY, "--machine", "lander_control", "--ros", endpoint, "--socket", address, "--paused"]
    with started("fcsl-fc", *line), bridge(endpoint) as session:
        latched = subscribe_latched(session, "lander_control/state", came)
        until(address.exists)
        with VarClient(address) as client:
            client.tick(3)
            told = deserialize_message(came.get(timeout=LONG_S), MachineState)
            client.set_state("COAST")
            changed = deserialize_message(came.get(timeout=LONG_S), MachineState)
        latched.undeclare()
    assert (told.state, changed.state, changed.tick) == ("ASCENT", "COAST", 2)


def read(sample: zenoh.Sample, kind: type[Message]) -> Message:
    return cast(Message, deserialize_message(bytes(sample.payload), kind))


def tick_of(message: Any) -> int:
    stamp = message.header.stamp
    return int((stamp.sec * 10**9 + stamp.nanosec) * HZ // 10**9)


def imu(rate: float, stamp_ns: int) -> bytes:
    message = Imu()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.angular_velocity.x = rate
    return bytes(serialize_message(message))


def test_a_hal_of_topics(tmp_path: Path) -> None:
    """Messages of the graph are the machine's sensors, its commands are topics. What is no good is refused and counted."""
    endpoint = free_endpoint()
    summary = tmp_path / "summary.json"
    commands: queue.Queue[TwistStamped] = queue.Queue()
    subprocess.run(["fcslc", "build", ECHO, "-o", tmp_path], check=True)
    socket = tmp_path / "fc.sock"
    options = ["--hal", f"ros:{endpoint}", "--namespace", "r1", "--summary", summary, "--socket", socket]

    def heard(sample: zenoh.Sample) -> None:
        commands.put(read(sample, TwistStamped))

    with (
        started("fcsl-fc", tmp_path / "libecho.so", *options) as fc,
        bridge(endpoint) as session,
        VarClient(socket) as client,
    ):
        counters = ["hal.messages", *client.list("hal.refused")]
        assert tokens(session) == {"r1/imu/data": ("MS", SENSOR), "r1/cmd_vel": ("MP", COMMAND)}
        everything = session.declare_subscriber("r1/cmd_vel", heard)

        def taken() -> int:
            return int(sum(client.get(*counters).values()))

        def command() -> float:
            """Of a tick that is still to come."""
            commands.queue.clear()
            return float([commands.get(timeout=LONG_S) for _ in range(3)][-1].twist.linear.x)

        def send(data: bytes) -> float:
            """The command behind the tick that has taken the message."""
            before = taken()
            session.put("r1/imu/data", data)
            until(lambda: taken() > before)
            return command()

        now_ns = time.time_ns()
        while taken() == 0:  # until the bridge has found it
            session.put("r1/imu/data", imu(42.0, time.time_ns()))
            time.sleep(0.5)
        until(lambda: command() == 42.0)
        assert send(imu(43.0, now := time.time_ns())) == 43.0
        for bad in (
            imu(1.0, now),  # repeated
            imu(2.0, now_ns),  # older
            imu(3.0, time.time_ns() + 10**11),  # future
            imu(4.0, time.time_ns())[:40],  # truncated
            b"\0\0" + imu(5.0, time.time_ns())[2:],  # encoding
            imu(float("nan"), time.time_ns()),
        ):
            assert send(bad) == 43.0
        assert send(imu(44.0, time.time_ns())) == 44.0
        fc.send_signal(signal.SIGTERM)
        _, complaint = fc.communicate(timeout=LONG_S)
        everything.undeclare()
    assert fc.returncode == 0, complaint
    counted = json.loads(summary.read_text())["hal"]
    refused = {name.removeprefix("refused."): n for name, n in counted.items() if name.startswith("refused.") and n}
    assert refused == dict.fromkeys(("repeated", "older", "future", "truncated", "encoding", "nan"), 1)
    assert counted["messages"] >= 3 and counted["superseded"] == 0 and counted["commands"] > 0


PUMP = """
class Gauge:
    outputs = {"level": "f64 m"}

    def execute(self):
        pass


class Pump:
    inputs = {"now": "i64"}
    outputs = {"speed": "f64 m/s", "height": "f64 m", "armed": "bool", "mode": "i32"}

    def execute(self):
        self.speed = 3.0
        self.height = 4.0
        self.armed = self.now < 2000000000
        self.mode = 1 if self.armed else 0
"""
TANK = {
    "tick_hz": HZ,
    "initial_state": "RUN",
    "algorithms": {"Gauge": {"source": "pump.py"}, "Pump": {"source": "pump.py"}},
    "instances": {"gauge": {"algorithm": "Gauge"}, "pump": {"algorithm": "Pump"}},
    "connections": [{"from": "machine.time_ns", "to": "pump.now"}],
    "states": {"RUN": {"schedule": {"gauge": HZ, "pump": HZ}}},
    "transitions": [],
    "publish": [],
    "arm": "pump.armed",
    "channels": [
        {"name": "level", "id": 1, "field": "gauge.outputs.level", "direction": "sensor", "max_age_ticks": 10}
        | {"ros": {"type": "geometry_msgs/PointStamped", "field": "point.z", "topic": "level", "frame": "tank"}},
        {"name": "speed", "id": 2, "field": "pump.outputs.speed", "direction": "actuator", "safe": -1.0}
        | {"ros": {"type": "geometry_msgs/TwistStamped", "field": "twist.linear.x", "topic": "/cmd_vel"}},
        {"name": "height", "id": 3, "field": "pump.outputs.height", "direction": "report"}
        | {
            "ros": {"type": "geometry_msgs/PoseWithCovarianceStamped", "field": "pose.pose.position.z", "topic": "pose"}
        },
        {"name": "mode", "id": 4, "field": "pump.outputs.mode", "direction": "report"}
        | {"ros": {"type": "std_msgs/String", "field": "data", "choices": ["off", "pumping"]}},
    ],
}
TANK_SIM = {
    "controller": {"machine": "tank.json"},
    "seed": 1,
    "duration": 4.0,
    "integrator": {"method": "euler", "hz": HZ},
    "models": {"sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}},
    "instances": {"meter": {"model": "sensor", "parameters": {"bias": 7.5, "sigma": 0.0, "dropout": False}}},
    "connections": [{"from": "meter.value", "to": "controller.level"}],
    "rates": {"meter": HZ // 2},
}


def test_mapped_channels_of_a_simulation(tmp_path: Path) -> None:
    """Sensors when they are sampled, actuators in every tick: the machine's value while it is armed, then the safe one.
    A report is the machine's value all the time, and a covariance that nobody gave is unknown."""
    (tmp_path / "pump.py").write_text(PUMP)
    (tmp_path / "tank.json").write_text(json.dumps(TANK))
    (tmp_path / "tank.sim.json").write_text(json.dumps(TANK_SIM))
    endpoint = free_endpoint()
    options = ["--ros", endpoint, "--namespace", "r1", "--speed", "2"]
    levels: list[PointStamped] = []
    commands: list[TwistStamped] = []
    poses: list[PoseWithCovarianceStamped] = []
    modes: list[str] = []
    with started("fcsl-sim", "run", tmp_path / "tank.sim.json", *options) as sim, bridge(endpoint) as session:
        declared = tokens(session)
        subscribers = [
            session.declare_subscriber("r1/level", lambda s: levels.append(read(s, PointStamped))),
            session.declare_subscriber("cmd_vel", lambda s: commands.append(read(s, TwistStamped))),
            session.declare_subscriber("r1/pose", lambda s: poses.append(read(s, PoseWithCovarianceStamped))),
            session.declare_subscriber("r1/mode", lambda s: modes.append(read(s, String).data)),
        ]
        said, complaint = sim.communicate(timeout=LONG_S)
        for subscriber in subscribers:
            subscriber.undeclare()
    assert sim.returncode == 0, complaint
    of_machine = {"state": LATCHED, "health": LATCHED, "faults": LATCHED, "transitions": EVENT}
    wanted = {f"r1/tank/{name}": quality for name, quality in of_machine.items()}
    wanted |= {"clock": STREAM, "r1/level": STREAM, "cmd_vel": COMMAND, "r1/pose": COMMAND, "r1/mode": COMMAND}
    assert declared == {topic: ("MP", quality) for topic, quality in wanted.items()}
    assert "ROS 2 topics: 400 ticks, 0 dropped" in said
    assert {(m.point.z, m.header.frame_id, tick_of(m) % 2) for m in levels} == {(7.5, "tank", 0)}
    assert [tick_of(m) for m in levels] == [tick_of(levels[0]) + 2 * i for i in range(len(levels))]
    assert [tick_of(m) for m in commands] == [tick_of(commands[0]) + i for i in range(len(commands))]
    assert len(levels) > HZ / 2 and len(commands) > HZ
    assert all(m.twist.linear.x == (3.0 if tick_of(m) < 200 else -1.0) for m in commands)
    assert {(m.pose.pose.position.z, m.pose.covariance[0], m.pose.covariance[7]) for m in poses} == {(4.0, -1.0, 0.0)}
    assert max(tick_of(m) for m in poses) > 200
    assert [mode for mode, _ in groupby(modes)] == ["pumping", "off"]


def test_events_of_a_simulation(tmp_path: Path) -> None:
    """Each with its own tick and text, several of a tick in their order."""
    law = """
class Law:
    outputs = {"y": "i64"}

    def execute(self):
        self.y = self.y + 1
        if self.y % 20 == 0:
            event("lap", self.y, severity="warning")
            event("again")
"""
    (tmp_path / "law.py").write_text(law)
    machine = {"tick_hz": HZ, "initial_state": "RUN", "publish": [], "algorithms": {"Law": {"source": "law.py"}}}
    machine |= {"instances": {"law": {"algorithm": "Law"}}, "states": {"RUN": {"schedule": {"law": HZ}}}}
    (tmp_path / "laps.json").write_text(json.dumps(machine))
    simulation = TANK_SIM | {"controller": {"machine": "laps.json"}, "connections": []}
    (tmp_path / "laps.sim.json").write_text(json.dumps(simulation))
    endpoint = free_endpoint()
    events: list[Event] = []
    options = ["--ros", endpoint, "--namespace", "r1", "--speed", "2"]
    with started("fcsl-sim", "run", tmp_path / "laps.sim.json", *options) as sim, bridge(endpoint) as session:
        assert tokens(session)["r1/laps/events"] == ("MP", EVENT)
        subscriber = session.declare_subscriber("r1/laps/events", lambda s: events.append(read(s, Event)))
        _, complaint = sim.communicate(timeout=LONG_S)
        subscriber.undeclare()
    assert sim.returncode == 0, complaint
    assert len(events) > 10
    first = events[0].tick
    wanted: list[tuple[int, str, list[str]]] = []
    for tick in range(first, first + 10 * len(events), 20):
        wanted += [(tick, "lap", [str(tick + 1)]), (tick, "again", [])]
    assert [(e.tick, e.text, list(e.values)) for e in events] == wanted
    assert {(e.instance, e.text, e.severity) for e in events} == {("law", "lap", 30), ("law", "again", 20)}
    assert [tick_of(e) for e in events] == [e.tick for e in events]
