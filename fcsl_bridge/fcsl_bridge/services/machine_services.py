# SPDX-License-Identifier: Apache-2.0
"""Services that change a machine between two ticks, ~/set_state, ~/save, ~/restore, ~/inject_fault, and one that says what
machine it is, ~/describe.

Each change is recorded, so that a replay applies it at the same tick. A refusal is an answer with its reason; nothing
changes.
"""

from __future__ import annotations

import errno
import os
import sys
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from fcsl_msgs.msg import Channel, Checkpoint
from fcsl_msgs.srv import Describe, InjectFault, Restore, Save, SetState
from simclient.checkpoint import read_checkpoint, write_checkpoint
from simclient.descriptor import Channel as MachineChannel
from simclient.descriptor import Service
from simclient.errors import TwinError, did_you_mean
from simclient.run import Run

from ..errors import BridgeError
from .dropouts import Dropouts

_Fault = InjectFault.Request
_NS = 1_000_000_000


@dataclass(frozen=True)
class Allowed:
    """Permissions of a run's services: force a state; change the tick (by restoring a checkpoint); inject faults;
    use files in `folder` (empty: none)."""

    forcing: bool
    leaving_tick: bool
    faults: bool
    folder: str

    def file(self, name: str) -> Path:
        """A file of this name.

        Raises BridgeError: callers of a service must not name arbitrary paths of this computer.
        """
        if not self.folder:
            raise BridgeError("not allowed to use files: start the node with -p checkpoints:=<folder>")
        if name != Path(name).name or name in (".", ".."):
            raise BridgeError(f"`{name}` is not a file's name; it goes to the folder {self.folder}")
        return Path(self.folder) / name


def _write(path: Path, content: bytes) -> None:
    if path.exists():
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    write_checkpoint(path, content)


async def _elsewhere(work: Callable[..., Any], *arguments: Any) -> Any:
    """Runs `work` in a separate thread, since the ticking thread must not wait for a disk; returns or raises its
    result.
    """
    done = Future()

    def run() -> None:
        try:
            done.set_result(work(*arguments))
        except Exception as error:
            done.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return await done


class MachineServices:
    """The services of a run of `library`. `restored` is called after the machine's memory was replaced."""

    def __init__(
        self,
        node: Node,
        library: Path,
        run: Run,
        dropouts: Dropouts,
        restored: Callable[[], None],
        allowed: Allowed,
    ):
        self._node, self._library, self._run, self._dropouts, self._restored = node, library, run, dropouts, restored
        self._allowed = allowed
        group = MutuallyExclusiveCallbackGroup()  # a separate group: rclpy's default one keeps every former entity
        table = (
            (Describe, "~/describe", self._describe),
            (SetState, "~/set_state", _answering(self._set_state)),
            (Save, "~/save", _answering(self._save)),
            (Restore, "~/restore", _answering(self._restore)),
            (InjectFault, "~/inject_fault", _answering(self._inject_fault)),
        )
        self._services = [
            node.create_service(kind, name, callback, callback_group=group) for kind, name, callback in table
        ]

    def close(self) -> None:
        for service in self._services:
            self._node.destroy_service(service)

    def _need_forcing(self) -> None:
        if not self._allowed.forcing:
            raise BridgeError("not allowed: start the node with -p allow_set_state:=true")

    def _describe(self, request: Any, response: Any) -> Any:
        machine = self._run.machine
        response.machine, response.library = machine.name, str(self._library.absolute())
        response.source_hash, response.layout_hash, response.build_hash = (
            machine.source_hash,
            machine.layout_hash,
            machine.build_hash,
        )
        response.tick_hz, response.states = machine.tick_hz, list(machine.states)
        services = {service.channel: service for service in machine.services}
        response.channels = [
            Channel(
                name=channel.name,
                id=channel.id,
                direction=channel.direction,
                type=channel.field.type_text,
                unit=channel.field.unit,
                **self._mapped(channel, services.get(channel.index)),
            )
            for channel in machine.channels
        ]
        return response

    def _mapped(self, channel: MachineChannel, service: Service | None) -> dict[str, str]:
        """What carries a channel, in the fields of fcsl_msgs/Channel."""
        if service is not None:
            return {"topic": self._node.resolve_service_name(service.name), "message": service.type}
        if not channel.ros_type:
            return {}
        topic = self._node.resolve_topic_name(channel.ros_topic)
        return {"topic": topic, "message": channel.ros_type, "field": channel.ros_field}

    async def _set_state(self, request: Any, response: Any) -> None:
        self._need_forcing()
        states = self._run.machine.states
        if request.state not in states:
            hint = did_you_mean(request.state, states) or f"; there are {', '.join(states)}"
            raise BridgeError(f"no state `{request.state}`{hint}")
        self._run.set_state(states.index(request.state))

    async def _save(self, request: Any, response: Any) -> None:
        run, machine, data = self._run, self._run.machine, self._run.save()
        tick = run.tick
        if request.file:
            await _elsewhere(_write, self._allowed.file(request.file), run.checkpoint())
        held: Checkpoint = response.checkpoint
        held.header.stamp.sec, held.header.stamp.nanosec = divmod(machine.time_ns(tick), _NS)
        held.tick, held.machine, held.data = tick, machine.name, data
        held.source_hash, held.layout_hash, held.build_hash = (
            machine.source_hash,
            machine.layout_hash,
            machine.build_hash,
        )

    async def _restore(self, request: Any, response: Any) -> None:
        self._need_forcing()
        machine, held = self._run.machine, request.checkpoint
        content = b""
        if request.file:
            content = await _elsewhere(read_checkpoint, self._allowed.file(request.file))
            tick = self._run.checkpoint_tick(content)
        elif held.layout_hash != machine.layout_hash:
            raise BridgeError(f"the checkpoint is of a machine of another layout than `{machine.name}`")
        else:
            data = bytes(held.data)
            tick = int.from_bytes(data[(at := machine.fields["machine.tick"].offset) : at + 8], sys.byteorder)
        if tick != self._run.tick and not self._allowed.leaving_tick:
            raise BridgeError(
                f"the checkpoint is of tick {tick}, and the simulator is at tick {self._run.tick}: in lock-step only a "
                f"checkpoint of the same tick can be restored"
            )
        was_armed = self._run.is_armed
        if request.file:
            self._run.restore_checkpoint(content)
        else:
            self._run.restore(data)
        if not was_armed and self._allowed.leaving_tick:  # in lock-step the simulator has the gate
            self._run.require_arming()
        self._restored()

    async def _inject_fault(self, request: Any, response: Any) -> None:
        if not self._allowed.faults:
            raise BridgeError("only where time is simulated: mode lockstep or clock, or use_sim_time")
        if request.kind == _Fault.DROPOUT:
            self._dropouts.add(request.name, request.ticks)
            return
        kinds = {_Fault.FAULT: self._run.inject_fault, _Fault.OVERRUN: self._run.inject_overrun}
        if request.kind not in kinds:
            raise BridgeError(f"no kind {request.kind}; there are FAULT 0, OVERRUN 1, DROPOUT 2")
        names = [instance.name for instance in self._run.machine.instances]
        if request.name not in names:
            hint = did_you_mean(request.name, names) or f"; there are {', '.join(names)}"
            raise BridgeError(f"no instance `{request.name}`{hint}")
        kinds[request.kind](names.index(request.name))


def _answering(serve: Callable[[Any, Any], Awaitable[None]]) -> Callable[[Any, Any], Awaitable[Any]]:
    """A service callback; errors of `serve` become refusals."""

    async def callback(request: Any, response: Any) -> Any:
        try:
            await serve(request, response)
            response.success = True
        except (BridgeError, TwinError) as error:
            response.message = str(error)
        except OSError as error:
            response.message = f"{error.filename}: {error.strerror}"
        return response

    return callback
