# SPDX-License-Identifier: Apache-2.0
"""The lock-step protocol: two processes step together, tick by tick, with the results of one process.

    simulator end                    <machine>/lockstep/…                                controller end
    send(k, message)    sensors  ── TICK k, message ──►              next() returns the message; the machine steps k
    answer() returns    ◄── TICK k, message ── actuators                                 answer(message)
    alive()             sensors  ── ALIVE k ──►              next() keeps waiting: the simulator is paused, or waits for others
    (answer waits on)   ◄── ALIVE k ── actuators                 alive(): the controller is not active
    reset(), send(0, …) sensors  ── TICK 0 of run r + 1 ──►          next() reports a new run
    end(k)              sensors  ── END k ──►                        next() returns None
    Left is raised      ◄── END k ── actuators                                           leave()

Other received messages, the same at both ends:
    a bundle of an earlier run, or of a completed tick         dropped, counted (`dropped`); error if it differs from the first
    a bundle of a later tick                                   error: the bundle that is due was lost
    another machine (hash), or damaged                         error
    nothing for timeout_s, neither TICK nor ALIVE              error that names the tick
    a later run, at the simulator                              before its first answer: it begins an even later run; then: error
A controller that starts late receives the last bundles (qos.LOCKSTEP). If tick 0 is among them, it catches up, and its
answers to completed ticks are dropped; otherwise it waits for a reset. Every error is a BridgeError. The messages are
fcsl_msgs/TickBundle with fixed offsets, since frame_id is empty.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from dataclasses import dataclass

from rclpy.duration import Duration
from rclpy.node import Node

from fcsl_msgs.msg import TickBundle
from simclient.descriptor import Machine

from . import qos
from .errors import BridgeError
from .polled import SERVE_PERIOD_S, Polled

TICK, END, ALIVE = int(TickBundle.TICK), int(TickBundle.END), int(TickBundle.ALIVE)

#: Period of ALIVE messages of an end that sends nothing else, in s.
ALIVE_PERIOD_S = 0.5
#: A process that did not run for this long was itself stopped (Ctrl-Z, a debugger) and must not report a timeout, in s.
_STOPPED_S = 0.5
_RUN_MASK = 0xFFFFFFFF
#: How long the last message of a run may take to reach the other end, and that of an end which is interrupted: the other one
#: may have been killed, which DDS notices late.
_END_TIMEOUT, _LEAVE_TIMEOUT = Duration(seconds=5), Duration(seconds=0.3)
_NS = 1_000_000_000

#: CDR: encapsulation; stamp, frame_id ("": length 1 and a NUL), tick, run, machine, kind, length of the message.
_HEAD = struct.Struct("<4s iI IB3x Q I 4x Q B3x I".replace(" ", ""))
_ENCAPSULATION = b"\x00\x01\x00\x00"
_EMPTY_TEXT = (1, 0)


@dataclass(frozen=True, slots=True)
class Bundle:
    """A TickBundle without its stamp, which follows from the tick."""

    tick: int
    run: int
    machine: int
    kind: int
    message: bytes = b""


def pack(bundle: Bundle, time_ns: int) -> bytes:
    """The bundle as CDR, stamped `time_ns`."""
    second, nanosecond = divmod(time_ns, _NS)
    b = bundle
    stamp = (second, nanosecond, *_EMPTY_TEXT)
    return _HEAD.pack(_ENCAPSULATION, *stamp, b.tick, b.run, b.machine, b.kind, len(b.message)) + b.message


def unpack(data: bytes) -> Bundle:
    """The bundle in a raw message. Raises BridgeError for anything but a TickBundle with an empty frame_id."""
    if len(data) < _HEAD.size:
        raise BridgeError(f"a damaged bundle: {len(data)} bytes, its head alone has {_HEAD.size}")
    magic, _, _, *text, tick, run, machine, kind, size = _HEAD.unpack_from(data)
    if magic[:2] != _ENCAPSULATION[:2] or tuple(text) != _EMPTY_TEXT or kind not in (TICK, END, ALIVE):
        raise BridgeError("a damaged bundle: not little-endian CDR with an empty frame_id and a known kind")
    if len(data) - _HEAD.size < size:
        raise BridgeError(f"a damaged bundle: a message of {size} bytes, of which {len(data) - _HEAD.size} are there")
    return Bundle(tick, run, machine, kind, data[_HEAD.size : _HEAD.size + size])


class Silence(BridgeError):
    """Nothing was received from the other end in time: it may not be running."""


class Left(BridgeError):
    """The other end left before the run was over."""


@dataclass(frozen=True, slots=True)
class Sensors:
    """The input of one controller tick. `first`: the first tick of a run, for which the machine restarts."""

    tick: int
    message: bytes
    first: bool


class _End:
    """The common part of both ends.

    `serve` is called at least every SERVE_PERIOD_S while waiting, and at every tick.
    """

    speaks = hears = other = ""

    def __init__(self, node: Node, machine: Machine, serve: Callable[[], None], name_space: str = ""):
        base = f"{name_space}/{machine.name}" if name_space else machine.name
        self._node, self._machine, self._serve = node, machine, serve
        self._hash = int(machine.source_hash[:16], 16)
        self._heard = Polled(node, TickBundle, f"{base}/lockstep/{self.hears}s", qos.LOCKSTEP)
        self._publisher = qos.publisher(node, TickBundle, f"{base}/lockstep/{self.speaks}s", qos.LOCKSTEP)
        self._said = self._deadline = self._timeout_s = 0.0
        self._hint = ""
        self._taken = (-1, -1, b"")  # run, tick and message of the last accepted bundle
        self.due = 0  #: the tick that the next TICK bundle must carry
        self.dropped = 0  #: duplicate bundles

    def _say(self, kind: int, tick: int, run: int, message: bytes = b"") -> None:
        self._said = time.monotonic()
        self._publisher.publish(pack(Bundle(tick, run, self._hash, kind, message), self._machine.time_ns(tick)))

    def _say_alive(self, tick: int, run: int) -> None:
        if self._silent:
            self._say(ALIVE, tick, run)

    @property
    def _silent(self) -> bool:
        """Whether it is time for an ALIVE message."""
        return time.monotonic() - self._said >= ALIVE_PERIOD_S

    def _say_end(self, tick: int, run: int, timeout: Duration) -> None:
        self._say(END, tick, run)
        self._publisher.wait_for_all_acked(timeout)

    def _expect(self, timeout_s: float) -> None:
        """Starts the timeout for the other end."""
        self._timeout_s, self._deadline = timeout_s, time.monotonic() + timeout_s

    def _hear(self) -> Bundle:
        """The next valid bundle of this machine, of any kind."""
        looked = time.monotonic()
        self._serve()
        while (data := self._heard.take()) is None:
            now = time.monotonic()
            if now - looked > _STOPPED_S:
                self._expect(self._timeout_s)
            looked, left = now, self._deadline - now
            if left <= 0:
                what = f"no {self.hears} bundle of tick {self.due} from the {self.other} within {self._timeout_s} s"
                raise Silence(f"{what} on {self._heard.topic}{self._hint}")
            self._heard.wait(min(left, SERVE_PERIOD_S))
            self._serve()
        return self._read(data)

    def _read(self, data: bytes) -> Bundle:
        """The bundle in a raw message. Raises BridgeError for a damaged one and for one of another machine."""
        bundle = unpack(data)
        if bundle.machine != self._hash:
            raise BridgeError(
                f"{self._heard.topic} carries bundles of machine {bundle.machine:016x}, but this is {self._machine.name} "
                f"{self._hash:016x}: build simulation and controller from the same sources"
            )
        return bundle

    def _drop(self, bundle: Bundle) -> None:
        """Counts a duplicate bundle. Raises BridgeError if its content differs from the first."""
        self.dropped += 1
        if bundle.kind == TICK and (bundle.run, bundle.tick) == self._taken[:2] and bundle.message != self._taken[2]:
            raise BridgeError(
                f"the {self.hears} bundle of tick {bundle.tick} arrived a second time with other content on "
                f"{self._heard.topic}; is more than one {self.other} running?"
            )

    def _take(self, bundle: Bundle) -> bytes:
        """Accepts the bundle that was due; returns its message."""
        self._taken = (bundle.run, bundle.tick, bundle.message)
        return bundle.message

    def _lost(self, bundle: Bundle) -> BridgeError:
        return BridgeError(f"no {self.hears} bundle of tick {self.due}: that of tick {bundle.tick} came instead")

    def close(self) -> None:
        """Destroys publisher and subscription."""
        self._heard.close()
        self._node.destroy_publisher(self._publisher)


def _run_number() -> int:
    """Quarters of a second since 1970, in 32 bits: shorter than the start of a process. So a simulator that replaces
    a killed one has a later run number, unless the clock went back (SimulatorEnd._take_over)."""
    return int(time.time() * 4) & _RUN_MASK


class SimulatorEnd(_End):
    """Sends the sensors of each tick and waits for the answers."""

    speaks, hears, other = "sensor", "actuator", "controller"

    def __init__(self, node: Node, machine: Machine, serve: Callable[[], None], name_space: str = ""):
        super().__init__(node, machine, serve, name_space)
        self.run = _run_number()
        self._sent = b""  # the message of the last sent tick
        self._answer: bytes | None = None  # the answer to it

    def send(self, tick: int, message: bytes) -> None:
        """Sends the sensors of tick `tick`."""
        self.due = tick
        self._sent, self._answer = message, None
        self._say(TICK, tick, self.run, message)

    def answer(self, timeout_s: float) -> bytes:
        """The actuator message of the last sent tick. Raises BridgeError, and Left if the controller ends."""
        self._expect(timeout_s)
        while self._answer is None:
            self._answer = self._judge(self._hear())
        return self._answer

    def _judge(self, bundle: Bundle) -> bytes | None:
        """The bundle's message, if it is the answer that is due."""
        if bundle.run > self.run:
            self._take_over(bundle)
        elif bundle.run < self.run or bundle.tick < self.due:
            self._drop(bundle)
        elif bundle.kind == END:
            raise Left(f"the controller ended the run: it does not answer tick {self.due}")
        elif bundle.tick > self.due:
            raise self._lost(bundle)
        elif bundle.kind == TICK:
            return self._take(bundle)
        else:
            self._expect(self._timeout_s)
        return None

    def _take_over(self, bundle: Bundle) -> None:
        """The controller has a later run number than this simulator. Before the first answer it is that of an earlier
        simulator, after which the clock went back: tick 0 is sent again, in an even later run."""
        if self._taken[0] >= 0:
            raise BridgeError(
                f"the controller answers another simulator (tick {bundle.tick} of run {bundle.run}, this is run "
                f"{self.run}); is more than one running?"
            )
        self.run = (bundle.run + 1) & _RUN_MASK
        self._say(TICK, self.due, self.run, self._sent)

    def alive(self, tick: int) -> None:
        """Keeps the controller waiting for tick `tick`; call it often."""
        self.due = tick
        self._say_alive(tick, self.run)

    def alive_if_answered(self) -> None:
        """Keeps the controller waiting for the next tick, if it has answered this one; call it often between send() and
        answer(), while waiting for other controllers. Raises the errors of answer()."""
        if self._silent and self._is_answered():
            self._say_alive(self.due + 1, self.run)

    def _is_answered(self) -> bool:
        while self._answer is None and (data := self._heard.take()) is not None:
            self._answer = self._judge(self._read(data))
        return self._answer is not None

    def reset(self) -> None:
        """The next tick is tick 0 of a new run."""
        self.run = max(self.run + 1, _run_number()) & _RUN_MASK
        self.due = 0

    def end(self, tick: int) -> None:
        """Sends END to the controller: there is no tick `tick`. Waits until it was received."""
        self._say_end(tick, self.run, _END_TIMEOUT)

    def leave(self, tick: int) -> None:
        """The same in the middle of a run; does not wait for long."""
        self._say_end(tick, self.run, _LEAVE_TIMEOUT)


class ControllerEnd(_End):
    """Waits for the sensors of each tick and answers."""

    speaks, hears, other = "actuator", "sensor", "simulator"

    def __init__(self, node: Node, machine: Machine, serve: Callable[[], None], name_space: str = ""):
        super().__init__(node, machine, serve, name_space)
        self._run: int | None = None  # None: no tick received yet
        self._met = False  # ALIVE was received before tick 0

    def next(self, timeout_s: float) -> Sensors | None:
        """The sensors of the tick that is due, or of tick 0 of a new run; None at the end. Raises BridgeError."""
        self._expect(timeout_s)
        while True:
            bundle = self._hear()
            new_run = self._run is None or bundle.run > self._run
            if not new_run and (bundle.run != self._run or bundle.tick < self.due):
                self._drop(bundle)
            elif bundle.kind == END:
                return None
            elif bundle.kind == ALIVE:
                self._expect(timeout_s)
                self._say_paused(bundle.tick)
            elif new_run and bundle.tick == 0:
                self._run, self.due, self._hint = bundle.run, 0, ""
                return Sensors(0, self._take(bundle), first=True)
            elif self._run is None:
                self._say_late(bundle.tick)
            elif new_run or bundle.tick > self.due:
                raise self._lost(bundle)
            else:
                return Sensors(bundle.tick, self._take(bundle), first=False)

    def _say_paused(self, tick: int) -> None:
        """Logs once that a simulator is present before its first tick."""
        if self._run is None and tick == 0 and not self._met:
            self._met = True
            self._node.get_logger().info("the simulator is there; it is paused before tick 0")

    def _say_late(self, tick: int) -> None:
        """Warns once that this end joined a run after its beginning."""
        if not self._hint:
            self._hint = f"; it was at tick {tick} already: reset it (service ~/reset) or start it after this node"
            self._node.get_logger().warning(f"waiting for tick 0 from the simulator{self._hint}")

    def answer(self, message: bytes) -> None:
        """Answers the tick that next() returned."""
        assert self._run is not None, "answer() before next()"
        self._say(TICK, self.due, self._run, message)
        self.due += 1

    def alive(self) -> None:
        """Keeps the simulator waiting while this end does not answer; call it often."""
        if self._run is not None:
            self._say_alive(self.due, self._run)

    def leave(self) -> None:
        """Sends END to the simulator: this end answers no further tick. Does not wait for long."""
        if self._run is not None:
            self._say_end(self.due, self._run, _LEAVE_TIMEOUT)
