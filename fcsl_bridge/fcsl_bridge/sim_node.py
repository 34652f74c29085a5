# SPDX-License-Identifier: Apache-2.0
"""The simulator as a ROS 2 node: publishes time, plant truth and sensors of tick k, then waits for the answer stamped k.

Topics, below the node's namespace but for /clock:
    /clock                    rosgraph_msgs/Clock      t_k
    sim/truth                 fcsl_msgs/PlantTruth     outputs of the plant's models at t_k
    <machine>/lockstep/sensors    fcsl_msgs/TickBundle     sensor channels of tick k (lockstep.py)
    <machine>/lockstep/actuators  fcsl_msgs/TickBundle     subscribed: the controller's answer to tick k
The exit status is 0 only if every tick was answered.
"""

from __future__ import annotations

import signal
import sys
import time
from array import array
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from fcsl_compiler.source_path import SourcePathError, resolve_source
from fcsl_msgs.msg import PlantTruth
from fcsl_sim.config import SimConfig, load
from fcsl_sim.native import Simulation

from . import qos
from .errors import BridgeError, Stopped
from .lockstep import SimulatorEnd
from .node_main import Option, Stop, not_negative, positive, read_options, run_node, wait_for_subscribers
from .polled import Housekeeping

OPTIONS = (
    Option("sim", str, None, "the path of a *.sim.json, or package://<package>/<path below its share folder>"),
    Option("seed", int, None, "a seed instead of the file's (a non-negative integer)"),
    Option("duration", float, None, "seconds of simulated time at most, instead of the file's"),
    Option("timeout_s", float, 5.0, "seconds to wait for the controller's answer to a tick"),
    Option("start_timeout_s", float, 60.0, "seconds to wait for the controller's first answer"),
    Option("wait_for_subscribers", int, 0, "how many subscribers /clock and truth need before the first tick"),
)
_PROGRESS_PERIOD_S = 2.0
#: How long the end of the run may take to reach the controller.
_END_TIMEOUT = Duration(seconds=5)
_NS = 1_000_000_000


def set_time(stamp: Time, time_ns: int) -> None:
    stamp.sec, stamp.nanosec = divmod(time_ns, _NS)


class Truth:
    """Outputs of all models as one message, reused from tick to tick."""

    def __init__(self, sim: Simulation):
        self._sim = sim
        self._paths = [f"{name}.{f.path}" for name, table in sim.tables.items() for f in table.of_role("output")]
        self.message = PlantTruth()
        for path in self._paths:
            value = sim.get(path)
            self.message.name += [f"{path}[{i}]" for i in range(len(value))] if isinstance(value, list) else [path]

    def read(self, tick: int, time_ns: int) -> PlantTruth:
        values = array("d")
        for path in self._paths:
            value = self._sim.get(path)
            values.extend(map(float, value) if isinstance(value, list) else (float(value),))
        set_time(self.message.header.stamp, time_ns)
        self.message.tick = tick
        self.message.value = values
        return self.message


@dataclass
class Progress:
    """Says every two seconds of real time how far the run is."""

    sim: Simulation
    begun: float = 0.0
    told: float = 0.0

    def start(self) -> None:
        """From the first answered tick on: waiting for the controller is not simulating."""
        self.begun = self.told = time.perf_counter()

    def tell(self) -> None:
        now = time.perf_counter()
        if now - self.told > _PROGRESS_PERIOD_S:
            self.told = now
            print(f"simulating: {self._at()} of at most {self._time_s(self.sim.ticks):.1f} s", flush=True)

    def summary(self, what: str) -> str:
        wall_s = time.perf_counter() - self.begun
        ticks, time_s = self.sim.tick, self._time_s(self.sim.tick)
        if not self.begun or ticks < 2:
            return f"{what}: {ticks} ticks answered"
        speed = f"{ticks / wall_s:.0f} ticks/s, {time_s / wall_s:.1f} times real time"
        return f"{what}: {ticks} ticks answered, {time_s:.3f} s of flight in {wall_s:.2f} s ({speed})"

    def _at(self) -> str:
        return f"tick {self.sim.tick}, {self._time_s(self.sim.tick):.1f} s"

    def _time_s(self, tick: int) -> float:
        return self.sim.machine.time_ns(tick) / 1e9


def _fly(node: Node, stop: Stop, sim: Simulation, options: dict[str, Any]) -> int:
    machine = sim.machine
    clock_message, clock = Clock(), qos.publisher(node, Clock, "/clock", qos.STREAM)
    truth, truth_publisher = Truth(sim), qos.publisher(node, PlantTruth, "sim/truth", qos.STREAM)
    housekeeping = Housekeeping(node, stop)
    lockstep, progress = SimulatorEnd(node, machine, housekeeping.serve), Progress(sim)
    timeout_s = options["start_timeout_s"]
    try:
        wait_for_subscribers((clock, truth_publisher), options["wait_for_subscribers"], timeout_s, stop)
        print(f"{machine.name}: waiting for a controller", flush=True)
        while sim.status == "running":
            tick = sim.tick
            time_ns = machine.time_ns(tick)
            lockstep.send(tick, sim.sense())
            set_time(clock_message.clock, time_ns)
            clock.publish(clock_message)
            truth_publisher.publish(truth.read(tick, time_ns))
            sim.actuate(lockstep.answer(timeout_s))
            if tick == 0:
                progress.start()
                timeout_s = options["timeout_s"]
            progress.tell()
        lockstep.end(sim.tick)
        clock.wait_for_all_acked(_END_TIMEOUT)
    except Stopped:
        # The controller may have this tick already; the next one will not come.
        lockstep.end(sim.tick + 1)
        print(progress.summary(f"interrupted at tick {sim.tick}"))
        return 128 + (stop.signal or signal.SIGINT)
    finally:
        housekeeping.close()
    print(progress.summary("the stop condition held" if sim.status == "until" else "the duration is over"))
    return 0


def _load(options: dict[str, Any]) -> SimConfig:
    if not options["sim"]:
        raise BridgeError("parameter `sim` is missing: -p sim:=<path of a *.sim.json>")
    positive(options, "duration", "timeout_s", "start_timeout_s")
    not_negative(options, "seed", "wait_for_subscribers")
    try:
        package = options["sim"].startswith("package://")
        path = resolve_source(options["sim"], config=Path()) if package else Path(options["sim"])
    except SourcePathError as error:
        raise BridgeError(f"parameter `sim`: {options['sim']}: {error}") from None
    duration = options["duration"]
    config = load(path, seed=options["seed"], duration_s=None if duration is None else Fraction(str(duration)))
    for warning in config.warnings:
        print(warning, file=sys.stderr)
    return config


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    config = _load(options)
    with Simulation(config.plan, config.tables) as sim:
        return _fly(node, stop, sim, options)


def main() -> None:
    sys.exit(run_node("sim_node", OPTIONS, _body))
