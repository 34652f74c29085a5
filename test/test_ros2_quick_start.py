# SPDX-License-Identifier: Apache-2.0
"""docs/start/ros2.md runs as printed, in one shell that knows nothing of this workspace: its files and commands in their order."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from fcsl_bridge.domain import own_domain

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/start/ros2.md").read_text()
#: A file, which the sentence before it names, too, or commands.
STEP = re.compile(r"(?:<!-- file: (\S+) -->\n```\w+|```sh)\n(.*?)```\n", re.DOTALL)
LIMIT_S = 600.0
#: The robot's bag: 5 s of driving.
BAG_HZ, BAG_MESSAGES, BAG_SPEED = 50, 250, 0.1
#: The page's limit of the speed, in m/s.
SPEED_LIMIT = 0.2

#: `ros2` where there is none, or without the command: the verbs of `ros2 fcsl` alone, and one message of a topic.
ROS2 = f"""
ros2() {{
    if command ros2 "$1" --help >/dev/null 2>&1; then command ros2 "$@"
    elif [ "$1" = fcsl ]; then python3 {ROOT}/fcsl_bridge/test/run_verb.py "${{@:2}}"
    else python3 ~/one_message.py "${{@: -1}}"; fi
}}
"""
ONE_MESSAGE = """
import sys, time
import rclpy
from fcsl_bridge.topics.interfaces import message_class

rclpy.init()
node, topic, messages = rclpy.create_node("one_message"), sys.argv[1], []
end = time.monotonic() + 30.0
while topic not in (known := dict(node.get_topic_names_and_types())):
    if time.monotonic() > end:
        sys.exit(f"nobody publishes {topic}")
    time.sleep(0.05)
node.create_subscription(message_class(known[topic][0]), topic, messages.append, 10)
while not messages:
    if time.monotonic() > end:
        sys.exit(f"no message on {topic}")
    rclpy.spin_once(node, timeout_sec=1.0)
for name in messages[0].get_fields_and_field_types():
    print(f"{name}: {getattr(messages[0], name)}")
"""
#: What a user sees before he goes on: the machine runs, and the robot's odometry arms it. A node that has ended is not waited for.
WAIT = 'until ros2 topic echo --once /my_rover/controller | grep -qi "armed: true"; do kill -0 $!; done\n'


def steps() -> list[tuple[str, str]]:
    """File, or nothing, and text of each step."""
    found = STEP.findall(PAGE)
    assert PAGE.count("```\n") == len(found), "a block is neither a file nor commands"
    for name, _ in found:
        assert not name or f"`{name}`" in PAGE, f"no sentence names {name}"
    return found


def script() -> str:
    """The whole page. A line of its output begins each block of commands."""
    lines, block = [ROS2], 0
    for name, text in steps():
        if name:
            lines.append(f"cat > {name} <<'END'\n{text}END\n")
            continue
        lines.append(f"echo '@ {block}'\n" + (WAIT if "ros2 fcsl list" in text else "") + text)
        block += 1
    return "".join(lines)


def write_robot_bag(path: Path) -> None:
    """A bag as a robot's recorder leaves it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = store.types
    origin = kind["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    level = kind["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    still = kind["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    pose = kind["geometry_msgs/msg/PoseWithCovariance"](kind["geometry_msgs/msg/Pose"](origin, level), np.zeros(36))
    twist = kind["geometry_msgs/msg/TwistWithCovariance"](kind["geometry_msgs/msg/Twist"](still, still), np.zeros(36))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        for number in range(BAG_MESSAGES):
            ns = (1000 * BAG_HZ + number) * 1_000_000_000 // BAG_HZ
            stamp = kind["builtin_interfaces/msg/Time"](ns // 1_000_000_000, ns % 1_000_000_000)
            origin.x = BAG_SPEED * number / BAG_HZ
            header = kind["std_msgs/msg/Header"](stamp, "odom")
            message = kind["nav_msgs/msg/Odometry"](header, "base_link", pose, twist)
            writer.write(topic, ns, store.serialize_cdr(message, "nav_msgs/msg/Odometry"))


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """What the page supposes: FCSL's folder, a workspace, a bag of a robot."""
    (tmp_path / "fcsl").symlink_to(ROOT)
    (tmp_path / "ws/src").mkdir(parents=True)
    (tmp_path / "one_message.py").write_text(ONE_MESSAGE)
    write_robot_bag(tmp_path / "ws/robot_bag")
    return tmp_path


def run(home: Path) -> list[str]:
    """What each block of commands printed."""
    with own_domain(os.getpid()) as domain:
        kept = {name: os.environ[name] for name in ("PATH", "LANG") if name in os.environ}
        environment = kept | {"HOME": str(home), "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(home / "log")}
        shell = subprocess.Popen(
            ["bash", "-e", "-c", script()],
            env=environment,
            cwd=home,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            out, err = shell.communicate(timeout=LIMIT_S)
        finally:
            try:
                os.killpg(shell.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass  # nothing is left of it
        assert shell.returncode == 0, f"{out}\n{err}"
    return re.split(r"^@ \d+\n", out, flags=re.MULTILINE)[1:]


def commands(home: Path, bag: str) -> np.ndarray:
    """The machine's commands in a bag."""
    column, table = "controller.outputs.command", home / f"{bag}.csv"
    line = ["fcsl", "bag", "export", str(home / "ws" / bag), "-o", str(table), "--columns", column]
    subprocess.run(line, check=True, capture_output=True, timeout=LIMIT_S)
    return np.genfromtxt(table, delimiter=",", names=True, deletechars="")[column]


def test_the_quick_start_runs_as_printed(home: Path) -> None:
    new, build, _, look, replay, answer = run(home)
    assert "my_rover/package.xml" in new
    assert "1 passed" in build and "1 package finished" in build
    (line,) = re.findall(r"ros2 fcsl list +# (.*)", PAGE)
    assert look.splitlines()[:2] == [line, "RUN"] and "/cmd_vel (geometry_msgs/Twist, linear.x)" in look
    assert "linear: " in look and "armed: true" in look.lower()
    assert re.search(r"\d ticks, identical", replay), replay
    assert commands(home, "drive").max() == pytest.approx(SPEED_LIMIT)
    assert re.search(rf"^  position +{BAG_MESSAGES} +{BAG_MESSAGES} +0 ", answer, re.MULTILINE), answer
    assert commands(home, "answer").max() == pytest.approx(SPEED_LIMIT)
    for picture in ("drive.png", "answer.png"):
        assert (home / "ws" / picture).stat().st_size > 10_000
