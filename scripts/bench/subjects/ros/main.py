# SPDX-License-Identifier: Apache-2.0
"""The nodes of ROS 2: a 1 kHz machine with a topic for each of its axes in controller_node, the same as a plain rclpy
node, and lock-step.

The package in this folder, with a machine of AXES axes, is built once below OUT. Both nodes are heard by the same
listener, one after the other.
"""

from __future__ import annotations

import functools
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_bridge.domain import own_domain
from fcsl_bridge.loopback import loopback_environment
from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.cache import build_machine

from ...harness.size import SUFFIX, sized

ROOT = Path(__file__).resolve().parents[4]
PACKAGE = ROOT / "scripts/bench/subjects/ros"
PLAIN_NODE = ROOT / "scripts/bench/peers/plain_node.py"
OUT = ROOT / f"out/bench_ros{SUFFIX}"
PICTURE = ROOT / f"out/bench_ros{SUFFIX}.png"
WARM_UP_S, WINDOW_S = sized((4.0, 10.0), (0.5, 1.0))
LIMIT_S = 300
#: Each has a message of its own, which takes seconds to build.
AXES = sized(20, 2)
#: 1 of 20 ticks is published: 50 Hz.
DECIMATE = 20
LOCKSTEP_DECIMATES = (100, 1)
#: Where the nodes meet: on the bus, whose port follows from the domain, or on a Unix socket.
LOCKSTEP_PLACES = {"bus": "", "unix": f"unix:{OUT}/socket"}
LOCKSTEP_ROUNDS = sized(3, 1)
#: Edges of the latency histogram in microseconds, for the picture.
EDGES_US = np.geomspace(20, 20_000, 61)


def environment(domain: int) -> dict[str, str]:
    """Of the nodes: loopback alone, a ROS 2 domain."""
    return {**os.environ, **loopback_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}


def with_package(env: dict[str, str]) -> dict[str, str]:
    """And the package of this subject, which build() has built."""
    install = OUT / "install"
    python = next(install.glob("l*/python3*/*-packages"))
    added = {"AMENT_PREFIX_PATH": install, "PYTHONPATH": python, "LD_LIBRARY_PATH": install / "lib"}
    return {**env, **{name: f"{path}:{env.get(name, '')}" for name, path in added.items()}}


def write_package() -> Path:
    """The package with the machine. A file that is the same keeps its time."""
    folder, names = OUT / "package", [f"axis_{i:02d}" for i in range(AXES)]
    config = {
        "description": "Axes at 1 kHz, each with a topic of its own.",
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {"Axis": {"source": "algorithms/axis.py"}},
        "instances": {n: {"algorithm": "Axis", "parameters": {"frequency": 1 + i / 2}} for i, n in enumerate(names)},
        "connections": [{"from": "machine.dt", "to": f"{name}.dt"} for name in names],
        "states": {"RUN": {"schedule": dict.fromkeys(names, 1000)}},
    }
    for file in ("CMakeLists.txt", "package.xml", "algorithms/axis.py"):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PACKAGE / file, folder / file)
    rig, text = folder / "rig.json", json.dumps(config, indent=2)
    if not rig.exists() or rig.read_text() != text:
        rig.write_text(text)
    return folder


def build() -> None:
    """As colcon would; at once when nothing changed."""
    package, folder = write_package(), OUT / "build"
    (OUT / "COLCON_IGNORE").touch()  # what is installed here is no package of the workspace
    if not (folder / "CMakeCache.txt").exists():
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        configure = [*generator, "-S", package, "-B", folder, f"-DCMAKE_INSTALL_PREFIX={OUT / 'install'}"]
        _cmake(*configure, "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF")
    _cmake("--build", folder, "--target", "install", "--parallel", str(os.cpu_count()))


def _cmake(*arguments: object) -> None:
    done = subprocess.run(["cmake", *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"the package of {PACKAGE} was not built:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")


def _node(name: str, **parameters: object) -> list[str]:
    executable = package_prefix("fcsl_bridge") / "lib/fcsl_bridge" / name
    given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
    return [str(executable), "--ros-args", *given]


def heard(command: Sequence[str]) -> dict[str, Any]:
    """What the listener says of a node, and what the node says of itself when it is interrupted."""
    with own_domain() as domain:
        return _heard(command, with_package(environment(domain)))


def _heard(command: Sequence[str], env: dict[str, str]) -> dict[str, Any]:
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": env}
    with subprocess.Popen(command, **pipes) as node:
        try:
            line = [sys.executable, PACKAGE / "listener.py", node.pid, AXES, WARM_UP_S, WINDOW_S]
            said = subprocess.run(
                [*map(str, line)], stdout=subprocess.PIPE, text=True, check=True, env=env, timeout=LIMIT_S
            ).stdout
        finally:
            node.send_signal(signal.SIGINT)
            own, errors = node.communicate(timeout=LIMIT_S)
    facts: dict[str, Any] = json.loads(said)
    if not facts["messages"]:
        raise RuntimeError(f"{command[0]} published nothing: {errors[-2000:]}")
    facts["own"] = own
    return facts


def _summary(facts: dict[str, Any]) -> dict[str, Any]:
    delays_us = np.asarray(facts["delays_ns"]) / 1000
    p50, p99 = np.percentile(delays_us, [50, 99])
    latency = {"p50_us": p50, "p99_us": p99, "max_us": delays_us.max()}
    counts = {"ticks": facts["ticks"], "missed": max(0, facts["deadlines"] - facts["ticks"])}
    return {"processor_percent": 100 * facts["processor"], **counts, "messages": facts["messages"], "latency": latency}


def realtime() -> dict[str, Any]:
    """Both nodes: percent of one core, deadlines without a tick, delay from deadline to subscriber; and a picture."""
    build()
    machine = _node("controller_node", machine="bench_rig/rig", mode="realtime", decimate=DECIMATE)
    sides = {"machine": heard(machine), "plain": heard([sys.executable, str(PLAIN_NODE), str(AXES)])}
    figures = {name: _summary(facts) for name, facts in sides.items()}
    draw({name: np.asarray(facts["delays_ns"]) / 1000 for name, facts in sides.items()}, figures)
    return figures


def draw(delays_us: dict[str, Any], figures: dict[str, Any]) -> None:
    """PICTURE: both histograms of the delay, one above the other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    titles = {"machine": "an FCSL machine in controller_node", "plain": "the same as a plain rclpy node"}
    figure = Figure(figsize=(9, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    for panel, (name, values) in zip(axes, delays_us.items(), strict=True):
        facts = figures[name]
        panel.hist(np.clip(values, EDGES_US[0], EDGES_US[-1]), bins=EDGES_US, color="C0" if name == "machine" else "C1")
        panel.set_title(
            f"{titles[name]}: {facts['processor_percent']:.0f} % of a core, {facts['missed']} of "
            f"{facts['ticks'] + facts['missed']} ticks missed",
            loc="left",
        )
        for key in ("p50_us", "p99_us"):
            panel.axvline(facts["latency"][key], color="black", linestyle="--" if key == "p99_us" else "-", linewidth=1)
        panel.set_ylabel("messages")
    axes[0].set_xscale("log")
    axes[1].set_xlabel("µs from a tick's deadline to a raw subscriber's callback (line: median, dashed: 99 %)")
    figure.savefig(PICTURE, dpi=110)


def lockstep() -> dict[str, Any]:
    """Ticks per second of the lander in lock-step, over the bus and over a Unix socket: of two native programs, and of sim_node and
    controller_node by how many ticks share one publication, and with a subscriber of all topics, for which the flight waits. They
    take turns; medians. Keys like `unix decimate_1`."""
    with own_domain() as domain:
        env = environment(domain)
        OUT.mkdir(parents=True, exist_ok=True)
        native = {"bus": f"zenoh:tcp:127.0.0.1:{7500 + domain}", "unix": f"wire:{LOCKSTEP_PLACES['unix']}"}
        ways: dict[str, Callable[[], float]] = {}
        for name, place in LOCKSTEP_PLACES.items():
            ways[f"{name} native"] = functools.partial(_fly_native, native[name])
            ways |= {f"{name} decimate_{n}": functools.partial(_fly, n, env, place) for n in LOCKSTEP_DECIMATES}
            ways[f"{name} subscribed"] = functools.partial(_fly_subscribed, env, place)
        rounds = [{name: fly() for name, fly in ways.items()} for _ in range(LOCKSTEP_ROUNDS)]
    return {name: statistics.median(found[name] for found in rounds) for name in ways}


def _fly_native(place: str) -> float:
    lander = ROOT / "examples/lander"
    library = build_machine(lander / "fc/lander_control.json").library
    line = ["fcsl-sim", "run", str(lander / "sim/lander.sim.json"), "--seed", "1", "--external", place, "--json"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as simulator:
        flight = ["fcsl-fc", str(library), "--hal", place, "--timeout", "20"]
        subprocess.run(flight, stdout=subprocess.DEVNULL, check=True, timeout=LIMIT_S)
        said = json.loads(simulator.communicate(timeout=LIMIT_S)[0])
    return float(said["ticks"] / said["wall_s"])


def _fly_subscribed(env: dict[str, str], place: str) -> float:
    executable = package_prefix("fcsl_bridge") / "lib/fcsl_bridge/topic_count"
    line = [str(executable), "--ros-args", "-p", "machine:=lander_control", "-p", "topics:=[/odom]"]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env) as listening:
        try:
            assert listening.stderr is not None
            listening.stderr.readline()  # it waits for topics
            return _fly(1, env, place, wait_for_subscribers=1)
        finally:
            listening.kill()


def _fly(decimate: int, env: dict[str, str], place: str, **given: Any) -> float:
    both: dict[str, Any] = {"decimate": decimate, **given} | ({"bus": place} if place else {})
    sim = _node("sim_node", sim="package://lander/sim/lander.sim.json", seed=1, **both)
    controller = _node("controller_node", machine="lander/lander_control", **both)
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": env}
    with subprocess.Popen(controller, **pipes) as answering:
        flown = subprocess.run(sim, capture_output=True, text=True, env=env, timeout=LIMIT_S)
        _, errors = answering.communicate(timeout=LIMIT_S)
    rate = re.search(r"\((\d+) ticks/s", flown.stdout)
    if not rate:
        raise RuntimeError(
            f"the lander did not fly in lock-step: {flown.stdout[-500:]}{flown.stderr[-500:]}{errors[-500:]}"
        )
    return float(rate.group(1))
