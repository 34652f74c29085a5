# SPDX-License-Identifier: Apache-2.0
"""The simulator as a ROS 2 node: publishes time, plant truth and sensors of tick k, then waits for the answer stamped k.

    /clock                        rosgraph_msgs/Clock               t_k; back to 0 at a reset
    sim/truth, …                  see sim_topics.py                 for each vehicle, below its namespace
    <machine>/lockstep/sensors    fcsl_msgs/TickBundle              likewise: sensor channels of tick k (lockstep.py)
    <machine>/lockstep/actuators  fcsl_msgs/TickBundle              subscribed: the controller's answer to tick k
    /diagnostics                  diagnostic_msgs/DiagnosticArray   once per second: rate of simulated time
    ~/pause, ~/resume, ~/step, ~/reset                              see sim_control.py
The exit status is 0 only if every tick was answered.
"""

from __future__ import annotations

import signal
import struct
import sys
from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from fcsl_sim.config import SimConfig, load

from . import qos
from .errors import BridgeError, Stopped
from .node_main import (
    Option,
    Stop,
    not_negative,
    positive,
    read_options,
    run_node,
    wait_for_receivers,
    wait_for_subscribers,
)
from .polled import Housekeeping
from .sim_control import Control, Reset, speed_problem
from .sim_progress import Progress
from .sim_vehicle import Vehicle

OPTIONS = (
    Option("sim", str, None, "the path of a *.sim.json, or package://<package>/<path below its share folder>"),
    Option("vehicles", list, None, "a list of namespaces, each with a simulation and a controller of its own"),
    Option("seed", int, None, "a seed instead of the file's (a non-negative integer); vehicle number i has seed + i"),
    Option("duration", float, None, "seconds of simulated time at most, instead of the file's"),
    Option("speed", float, 0.0, "simulated seconds per second at most; 0: as fast as possible", settable=True),
    Option("paused", bool, False, "true: no tick begins; see ~/step", settable=True),
    Option("decimate", int, 1, "a whole number n: truth is published each n-th tick"),
    Option("timeout_s", float, 5.0, "seconds to wait for the controller's answer to a tick"),
    Option("start_timeout_s", float, 60.0, "seconds to wait for the controller's first answer"),
    Option("wait_for_subscribers", int, 0, "how many subscribers /clock and sim/truth need before the first tick"),
)
#: rosgraph_msgs/Clock as CDR.
_CLOCK = struct.Struct("<4siI")
_ENCAPSULATION = b"\x00\x01\x00\x00"
_NS = 1_000_000_000
#: How long the last /clock and truth may take to reach all subscribers, in s.
_END_S = 5.0


class Simulator:
    """All vehicles, tick by tick, on one clock."""

    def __init__(self, node: Node, stop: Stop, configs: Mapping[str, SimConfig], options: dict[str, Any]):
        """configs: the simulation of each vehicle, by its namespace (empty: the node's own)."""
        self._stop, self._options = stop, options
        self._housekeeping = Housekeeping(node, stop)
        self._control = Control(node, self._housekeeping, options["speed"], options["paused"])
        self._vehicles: list[Vehicle] = []
        try:
            for name, config in configs.items():
                self._vehicles.append(Vehicle(node, config, name, options["decimate"], self._serve))
        except BaseException:
            self.close()
            raise
        self._machine = self._vehicles[0].sim.machine
        self._clock = qos.publisher(node, Clock, "/clock", qos.STREAM)
        self._progress = Progress(node, self._machine)
        self._tick = 0

    def close(self) -> None:
        for vehicle in self._vehicles:
            vehicle.close()
        self._housekeeping.close()

    def fly(self) -> int:
        """Runs to the end of every vehicle's run; returns the exit status. Raises BridgeError, which names the tick."""
        truth = [vehicle.topics.plant_publisher for vehicle in self._vehicles]
        needed, timeout_s = self._options["wait_for_subscribers"], self._options["start_timeout_s"]
        try:
            wait_for_subscribers((self._clock, *truth), needed, timeout_s, self._stop)
            print(f"{self._machine.name}: waiting for a controller", flush=True)
            while any(vehicle.running for vehicle in self._vehicles):
                try:
                    self._one_tick()
                except Reset:
                    self._begin_again()
        except Stopped:
            for vehicle in self._vehicles:
                vehicle.leave()
            print(self._progress.summary(f"interrupted at tick {self._tick}"))
            return 128 + (self._stop.signal or signal.SIGINT)
        wait_for_receivers((self._clock, *truth), _END_S)
        with suppress(Stopped):  # nothing is left to interrupt
            self._control.end()
        until = all(vehicle.sim.status == "until" for vehicle in self._vehicles)
        print(self._progress.summary("the stop condition held" if until else "the duration is over"))
        return 0

    def _one_tick(self) -> None:
        time_ns = self._machine.time_ns(self._tick)
        self._control.wait_for_turn(self._tick, time_ns, self._wait)
        running = [vehicle for vehicle in self._vehicles if vehicle.running]
        for vehicle in running:
            vehicle.send()
        self._say_time(time_ns)
        for vehicle in running:
            vehicle.topics.publish(vehicle.sim, time_ns)
        timeout_s = self._options["timeout_s" if self._tick else "start_timeout_s"]
        for vehicle in running:
            vehicle.take_answer(timeout_s)
        self._tick += 1
        self._tell()

    def _say_time(self, time_ns: int) -> None:
        self._clock.publish(_CLOCK.pack(_ENCAPSULATION, *divmod(time_ns, _NS)))

    def _serve(self) -> None:
        """Serves requests, and keeps other vehicles waiting, while one vehicle's answer is due."""
        self._control.serve()
        self._wait()

    def _wait(self) -> None:
        for vehicle in self._vehicles:
            vehicle.say_alive()
        self._tell()

    def _tell(self) -> None:
        self._progress.tell(self._tick, self._control, self._vehicles)

    def _begin_again(self) -> None:
        for vehicle in self._vehicles:
            vehicle.reset()
        self._tick = 0
        self._say_time(0)  # at once, because a paused simulation has no tick yet
        self._control.begin_run()
        self._progress.begin_run()
        print("reset: a new run begins", flush=True)


def _load(options: dict[str, Any], number: int) -> SimConfig:
    """The simulation of vehicle `number`."""
    path, duration, seed = options["sim"], options["duration"], options["seed"]
    duration_s = None if duration is None else Fraction(str(duration))
    config = load(path, seed=None if seed is None else seed + number, duration_s=duration_s)
    if number and seed is None:
        return load(path, seed=config.seed + number, duration_s=duration_s)
    for warning in config.warnings if number == 0 else ():
        print(warning, file=sys.stderr)
    return config


def _check(options: dict[str, Any]) -> list[str]:
    """The vehicles' namespaces; the empty one is the node's own. Raises BridgeError for an invalid parameter."""
    if not options["sim"]:
        raise BridgeError("parameter `sim` is missing: -p sim:=<path of a *.sim.json>")
    positive(options, "duration", "decimate", "timeout_s", "start_timeout_s")
    not_negative(options, "seed", "wait_for_subscribers")
    if problem := speed_problem(options["speed"]):
        raise BridgeError(f"parameter {problem}")
    vehicles = [name.rstrip("/") for name in options["vehicles"] or ["/"]]
    if options["vehicles"] and "" in vehicles:
        raise BridgeError(f"parameter `vehicles` holds namespaces, such as [one, two]; got {options['vehicles']!r}")
    if len(set(vehicles)) < len(vehicles):
        raise BridgeError(f"parameter `vehicles` names a namespace twice: {options['vehicles']!r}")
    return vehicles


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    configs = {name: _load(options, number) for number, name in enumerate(_check(options))}
    simulator = Simulator(node, stop, configs, options)
    try:
        return simulator.fly()
    finally:
        simulator.close()


def main() -> None:
    sys.exit(run_node("sim_node", OPTIONS, _body, parameter_services=True))
