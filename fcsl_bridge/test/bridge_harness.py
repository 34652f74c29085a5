# SPDX-License-Identifier: Apache-2.0
"""Processes and ROS 2 domains for tests. Every wait is for an event, with a timeout that only a failure reaches."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from fcsl_bridge.base.bus_address import endpoint
from fcsl_compiler.base.packages import package_prefix, package_share

LIMIT_S = 120.0
SIM = package_share("lander") / "sim" / "lander.sim.json"
MACHINE = "lander/lander_control"


class Process:
    """A node under test. A thread reads its output."""

    def __init__(self, command: Sequence[str | Path], environment: dict[str, str]):
        self.command = [str(word) for word in command]
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "bufsize": 1}
        self.process = subprocess.Popen(self.command, env=environment, **pipes)
        self.lines: dict[str, list[str]] = {"stdout": [], "stderr": []}
        self._news = threading.Condition()
        self._readers = [threading.Thread(target=self._read, args=(name,), daemon=True) for name in self.lines]
        for reader in self._readers:
            reader.start()

    def _read(self, name: str) -> None:
        for line in getattr(self.process, name):
            with self._news:
                self.lines[name].append(line)
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    @property
    def out(self) -> str:
        return "".join(self.lines["stdout"])

    @property
    def err(self) -> str:
        return "".join(self.lines["stderr"])

    def wait_for(self, text: str) -> None:
        """Returns once stdout or stderr contains `text`."""
        with self._news:
            dead = lambda: not any(reader.is_alive() for reader in self._readers)  # noqa: E731
            self._news.wait_for(lambda: text in self.out + self.err or dead(), LIMIT_S)
        assert text in self.out + self.err, f"{self.command[0]} never said {text!r}:\n{self.out}{self.err}"

    def signal(self, number: int) -> None:
        self.process.send_signal(number)

    def finish(self) -> int:
        """Waits for its end; returns the exit status."""
        status = self.process.wait(LIMIT_S)
        for reader in self._readers:
            reader.join(LIMIT_S)
        assert "Traceback" not in self.err, self.err
        return status


class Domain:
    """A ROS 2 domain, the processes in it, and nodes of the test itself."""

    def __init__(self, number: int, folder: Path):
        self.number, self.folder = number, folder
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(number), "ROS_LOG_DIR": str(folder / "ros_log")}
        self.processes: list[Process] = []
        self._opened: list[Listener | HandSimulator] = []

    def start(self, executable: str, *arguments: str, **parameters: Any) -> Process:
        """A node of fcsl_bridge, with ROS arguments and parameters."""
        path = package_prefix("fcsl_bridge") / "lib" / "fcsl_bridge" / executable
        return self.run([path, "--ros-args", *arguments, *_parameters(parameters)])

    def meeting(self, place: str) -> dict[str, str]:
        """The parameter of both nodes to meet there: `bus`, where they do by default, or `unix`, a socket."""
        return {"bus": f"unix:{self.folder}/socket"} if place == "unix" else {}

    def run(self, command: Sequence[str | Path]) -> Process:
        self.processes.append(Process(command, self.environment))
        return self.processes[-1]

    def listener(self) -> Listener:
        listener = Listener(self.number)
        self._opened.append(listener)
        return listener

    def simulator(self, listener: Listener) -> HandSimulator:
        simulator = HandSimulator(listener)
        self._opened.append(simulator)
        return simulator

    def close(self) -> None:
        """Nothing of the test stays behind: a simulator that still listens would keep the controllers of a later test."""
        for opened in reversed(self._opened):
            opened.close()
        for process in self.processes:
            if process.process.poll() is None:
                process.signal(signal.SIGKILL)
                process.process.wait()


def _parameters(parameters: dict[str, Any]) -> list[str]:
    return [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]


class Listener:
    """A node in the test's own process, spun by the test."""

    def __init__(self, domain: int):
        self.domain = domain
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("listener", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.received: dict[str, list[bytes]] = {}

    def subscribe(self, kind: Any, topic: str, profile: QoSProfile) -> None:
        """Collects the topic's messages as CDR."""
        messages = self.received.setdefault(topic, [])
        self.node.create_subscription(kind, topic, messages.append, profile, raw=True)

    def until(self, done: Callable[[], bool]) -> None:
        limit = time.monotonic() + LIMIT_S
        while not done():
            assert time.monotonic() < limit, "timeout: the expected event did not occur"
            self._executor.spin_once(timeout_sec=0.05)

    def spin(self) -> None:
        """Takes a message that is there."""
        self._executor.spin_once(timeout_sec=0.0)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


class HandSimulator:
    """A simulator on the bus, driven tick by tick by the test."""

    def __init__(self, listener: Listener):
        from fcsl_sim.config import load
        from fcsl_sim.native import Simulation

        config = load(SIM)
        self.sim = Simulation(config.plan, config.tables)
        self.listener = listener
        self._met = False
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("ROS_DOMAIN_ID", str(listener.domain))
            self.sim.listen(f"zenoh:{endpoint('')}", int(1000 * LIMIT_S))

    def meet(self) -> None:
        """Waits for the controller."""
        self.listener.until(lambda: self.sim.accept(20))
        self._met = True

    def tick(self) -> None:
        """One tick, with the controller's answer."""
        from fcsl_sim.native import run_together

        if not self._met:
            self.meet()
        self.listener.until(lambda: run_together([self.sim], 1, 20) == 1)
        self.listener.spin()

    def end(self, another_follows: bool = False) -> None:
        self.sim.end(another_follows)
        self.close()

    def close(self) -> None:
        self.sim.close()
