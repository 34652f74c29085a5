# SPDX-License-Identifier: Apache-2.0
"""The simulator as a ROS 2 node. It flies over the bus (docs/reference/transports.md) with a controller, and publishes what happens:

    /clock         rosgraph_msgs/Clock               t_k; back to 0 at a reset
    sim/truth, …   see sim_topics.py                 for each vehicle, below its namespace
    /diagnostics   diagnostic_msgs/DiagnosticArray   once per second: rate of simulated time
    ~/pause, ~/resume, ~/step, ~/reset               see sim_control.py
Native code makes the ticks, in slices; in between, the node serves its callbacks. The exit status is 0 only if every tick
was answered.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from fcsl_sim.config import SimConfig, load
from fcsl_sim.native import Failed, run_together

from ..base import bus_address
from ..base.bus_address import endpoint
from ..base.node_main import (
    Option,
    Stop,
    not_negative,
    positive,
    read_options,
    run_node,
    wait_for_receivers,
    wait_for_subscribers,
)
from ..base.polling import Housekeeping
from ..errors import BridgeError, Stopped
from ..simulator.sim_control import Control, Reset, speed_problem
from ..simulator.sim_progress import Progress
from ..simulator.sim_topics import below
from ..simulator.sim_vehicle import Vehicle
from ..topics import qos, tf
from ..topics.queue_publisher import NativeThread, QueuePublisher

OPTIONS = (
    Option("sim", str, None, "the path of a *.sim.json, or package://<package>/<path below its share folder>"),
    Option("vehicles", list, None, "a list of namespaces, each with a simulation and a controller of its own"),
    Option("seed", int, None, "a seed instead of the file's (a non-negative integer); vehicle number i has seed + i"),
    Option("duration", float, None, "seconds of simulated time at most, instead of the file's"),
    Option("speed", float, 0.0, "simulated seconds per second at most; 0: as fast as possible", settable=True),
    Option("paused", bool, False, "true: no tick begins; see ~/step", settable=True),
    tf.OPTION,
    Option("decimate", int, 1, "a whole number n: truth is published each n-th tick"),
    bus_address.OPTION,
    Option("timeout_s", float, 5.0, "seconds to wait for the controller's answer to a tick"),
    Option("start_timeout_s", float, 60.0, "seconds to wait for the controller's first answer"),
    Option("wait_for_subscribers", int, 0, "how many subscribers /clock and sim/truth need before the first tick"),
)
#: rosgraph_msgs/Clock as CDR, at time 0.
_CLOCK_ZERO = b"\x00\x01\x00\x00" + bytes(8)
#: How long native code runs before the node's callbacks are served, in ms.
_SLICE_MS = 50
#: How long the last /clock and truth may take to reach all subscribers, in s.
_END_S = 5.0


class Simulator:
    """All vehicles, tick by tick, on one clock."""

    def __init__(self, node: Node, stop: Stop, configs: Mapping[str, SimConfig], options: dict[str, Any]):
        """configs: the simulation of each vehicle, by its namespace (empty: the node's own)."""
        self._stop, self._options = stop, options
        self._endpoint = endpoint(options["bus"])
        self._housekeeping = Housekeeping(node, stop)
        self._control = Control(node, self._housekeeping, options["speed"], options["paused"])
        self._queue_publisher = QueuePublisher(lossless=options["wait_for_subscribers"] > 0)
        self._native = NativeThread(self._queue_publisher)
        self._vehicles: list[Vehicle] = []
        self._clock = qos.publisher(node, Clock, "/clock", qos.STREAM)
        self._clock_topic = self._queue_publisher.add(self._clock)
        try:
            for name, config in configs.items():
                # Vehicles of one simulation have the same frames: each has a tree of its own.
                shown = tf.Chosen(tuple(options["tf"] or ()), below(name, "tf") if len(configs) > 1 else tf.TOPIC)
                place = (self._endpoint, bool(self._vehicles))
                how = (options["decimate"], shown, *place, options["timeout_s"], self._queue_publisher)
                self._vehicles.append(Vehicle(node, config, name, *how))
        except BaseException:
            self.close()
            raise
        self._machine = self._vehicles[0].sim.machine
        self._progress = Progress(node, self._machine, self._queue_publisher.queue)
        self._tick = 0

    def close(self) -> None:
        self._native.close()
        for vehicle in reversed(self._vehicles):
            vehicle.close()
        self._queue_publisher.close()
        self._housekeeping.close()

    def fly(self) -> int:
        """Runs to the end of every vehicle's run; returns the exit status. Raises BridgeError, which names the tick."""
        truth = [vehicle.topics.plant_publisher for vehicle in self._vehicles]
        needed, timeout_s = self._options["wait_for_subscribers"], self._options["start_timeout_s"]
        try:
            wait_for_subscribers((self._clock, *truth), needed, timeout_s, self._stop.check)
            print(f"{self._machine.name}: waiting for a controller on {self._endpoint}", flush=True)
            self._fly_on()
        except Stopped:
            self._queue_publisher.all()
            for vehicle in self._vehicles:
                vehicle.sim.end(another_follows=False)
            print(self._progress.summary(f"interrupted at tick {self._tick}"))
            return 128 + (self._stop.signal or signal.SIGINT)
        self._queue_publisher.all()
        wait_for_receivers((self._clock, *truth), _END_S)
        with suppress(Stopped):  # nothing is left to interrupt
            self._control.end()
        until = all(vehicle.sim.status == "until" for vehicle in self._vehicles)
        print(self._progress.summary("the stop condition held" if until else "the duration is over"))
        return 0

    def _fly_on(self) -> None:
        self._begin_run()
        while any(vehicle.running for vehicle in self._vehicles):
            try:
                if not self._meet():
                    self._control.serve()
                    self._keep_alive()
                elif ticks := self._control.allowed():
                    self._run(ticks)
                else:
                    self._control.idle()
                    self._keep_alive()
            except Reset:
                self._begin_again()
            self._progress.update(self._tick, self._control, self._vehicles)

    def _begin_run(self) -> None:
        self._vehicles[0].sim.show_clock(self._queue_publisher.queue, self._clock_topic)
        for vehicle in self._vehicles:
            vehicle.topics.show(vehicle.sim)
            vehicle.listen()
        self._deadline_s = time.monotonic() + self._options["start_timeout_s"]

    def _meet(self) -> bool:
        """Whether all controllers are there. Raises BridgeError."""
        for vehicle in self._vehicles:
            if not vehicle.accepted:
                self._native(vehicle.accept, _SLICE_MS // len(self._vehicles) + 1)
        missing = [vehicle for vehicle in self._vehicles if not vehicle.accepted]
        if missing and time.monotonic() > self._deadline_s:
            limit_s = self._options["start_timeout_s"]
            raise BridgeError(_named(missing[0], f"no controller within {limit_s} s on {self._endpoint}"))
        return not missing

    def _run(self, ticks: int) -> None:
        first = self._vehicles[0].sim
        if self._control.pace_changed:
            self._control.pace_changed = False
            first.set_speed(self._control.speed)
        try:
            done = self._native(run_together, [vehicle.sim for vehicle in self._vehicles], ticks, _SLICE_MS)
        except Failed as error:
            raise BridgeError(_named(self._vehicles[error.number], str(error))) from None
        self._tick += done
        self._control.done(done, self._tick)

    def _keep_alive(self) -> None:
        """Controllers without a tick wait on."""
        for vehicle in self._vehicles:
            if vehicle.accepted:
                vehicle.sim.keep_alive()

    def _begin_again(self) -> None:
        self._queue_publisher.all()
        for vehicle in reversed(self._vehicles):
            vehicle.sim.end(another_follows=True)
            vehicle.reset()
        self._tick = 0
        self._clock.publish(_CLOCK_ZERO)  # at once, because a paused simulation has no tick yet
        self._control.begin_run()
        self._progress.begin_run()
        self._begin_run()
        print("reset: a new run begins", flush=True)


def _named(vehicle: Vehicle, text: str) -> str:
    """An error of a vehicle, with its namespace."""
    return f"{vehicle.name_space}: {text}" if vehicle.name_space else text


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
