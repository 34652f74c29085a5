# SPDX-License-Identifier: Apache-2.0
"""Shows a running machine in the rerun viewer: outputs, states, health, the plant's truth, the vehicle in 3D.

Subscribes below the node's namespace to <machine>/<instance>, <machine>/state and sim/truth; the entities are those of
bags (simclient.view.scene). Times are the stamps of the messages, on the timeline `sim_time`. When a run restarts, the
viewer gets a new recording, and `save` a new file. The viewer stays open when the node ends.
"""

from __future__ import annotations

import sys
import time

from rclpy.node import Node

from simclient.descriptor import Machine
from simclient.live.viewer import SPAWN, Viewer
from simclient.run import open_run
from simclient.view.blueprint import Plan
from simclient.view.feed import Feed
from simclient.view.scene import Cast, Scene
from simclient.view.views import views_or_remark

from ..base.machine_index import find_machine
from ..base.node_main import Option, Stop, read_options, run_node
from ..errors import BridgeError, Stopped
from ..topics.live_subscriptions import LiveSubscriptions, read_state, tick_of

OPTIONS = (
    Option("machine", str, None, "package/machine, or the path of a machine library"),
    Option(
        "connect",
        str,
        SPAWN,
        "spawn (a window on this machine), web (a page for a browser), none, or an address: rerun+http://127.0.0.1:9876/proxy",
    ),
    Option("save", str, "", "the path of an .rrd file to write as well"),
)
#: Periods of reading topics and of showing received messages, in s.
_POLL_S, _SHOW_S = 0.005, 0.1
#: How long the first outputs wait for a plant, in s: DDS discovery of a new process takes up to 3 s.
_PLANT_S = 4.0
#: When one topic restarts, the last messages of the others may arrive for this long, in s.
_SETTLE_S = 0.1


class LiveView:
    """Sends messages of topics to the viewer, run by run."""

    def __init__(self, node: Node, machine: Machine, viewer: Viewer):
        self._machine, self._viewer = machine, viewer
        self._topics = LiveSubscriptions(node, machine)
        self._show: _Show | None = None
        self._early: list[tuple[str, bytes]] = []
        self._early_since = 0.0
        self._ticks: dict[str, int] = {}
        self._state = b""
        self.messages = self.refused = self.runs = 0

    def poll(self) -> None:
        """Reads received messages. Those of a restarted run go to a new recording."""
        again: dict[str, list[bytes]] = {}
        self._take(again)
        if again:
            time.sleep(_SETTLE_S)
            self._take(again)
            self.finish()
            self._ticks.clear()
            self._state = b""
            for topic, messages in again.items():
                for data in messages:
                    self._hand_on(topic, data)

    def _take(self, again: dict[str, list[bytes]]) -> None:
        """Shows messages of this run; adds those of the next one, whose ticks restart, to `again`."""
        for topic, data in self._topics.drain():
            if topic in again or tick_of(data) < self._ticks.get(topic, 0):
                again.setdefault(topic, []).append(data)
            else:
                self._hand_on(topic, data)

    def _hand_on(self, topic: str, data: bytes) -> None:
        if topic == self._topics.state_topic:
            if data == self._state:
                return  # sent again, as a sign of life
            self._state = data
        self._ticks[topic] = tick_of(data)
        self.messages += 1
        if self._show is not None and topic not in self._show.feed.topics:
            self.finish()  # a plant appeared late: it is shown from here on, in a new recording
            self._early += [(self._topics.state_topic, self._state)] if self._state else []
        if self._show is None:
            self._early.append((topic, data))
            if topic != self._topics.state_topic:  # it has a message before the first tick
                self._early_since = self._early_since or time.monotonic()
        else:
            self._show.feed.take(topic, data)

    def show(self) -> None:
        """Shows the messages read; the first ones wait until the plant's signals are known."""
        if self._early_since and (self._topics.plant_is_known or time.monotonic() - self._early_since > _PLANT_S):
            self._begin()
        if self._show is not None:
            self._show.feed.flush()

    def _begin(self) -> None:
        """Opens a recording with the messages received so far."""
        self.runs += 1
        self._show = _Show(self._viewer, self._machine, self._topics)
        for topic, data in self._early:
            self._show.feed.take(topic, data)
        self._early, self._early_since = [], 0.0

    def finish(self) -> None:
        """Ends the recording: everything taken is shown, and the file is complete."""
        if self._early:
            self._begin()
        if self._show is not None:
            self._show.feed.flush()
            self.refused += self._show.feed.refused
            self._show.close()
            self._show = None


class _Show:
    """One run in the viewer."""

    def __init__(self, viewer: Viewer, machine: Machine, topics: LiveSubscriptions):
        self._stream = viewer.open(f"fcsl_{machine.name}")
        views, remark = views_or_remark(machine.views)
        cast = Cast(topics.prefix, list(topics.signals), machine.states, views=views, remark=remark)
        self._scene = Scene(self._stream, cast)
        self._stream.send_blueprint(Plan(cast, self._scene.world, None).blueprint())
        if self._scene.left_out:
            print(f"left out of the first page: {', '.join(self._scene.left_out)}", flush=True)
        self.feed = Feed(self._scene, dict(topics.layouts), topics.state_topic, read_state)

    def close(self) -> None:
        self._scene.until(self.feed.now_s)
        self._stream.disconnect()


def _body(node: Node, stop: Stop) -> int:
    options = read_options(node, OPTIONS)
    if not options["machine"]:
        raise BridgeError("parameter `machine` is missing: -p machine:=<package>/<machine>")
    run = open_run(*find_machine(options["machine"]))
    machine = run.machine
    run.close()
    viewer = Viewer(options["connect"], options["save"])
    view = LiveView(node, machine, viewer)
    if viewer.page:
        print(f"open {viewer.page}", flush=True)
    print(f"{machine.name}: waiting for its topics", flush=True)
    shown = time.monotonic()
    try:
        while True:
            stop.check()
            view.poll()
            if time.monotonic() - shown >= _SHOW_S:
                viewer.check()
                view.show()
                shown = time.monotonic()
            time.sleep(_POLL_S)
    except Stopped:
        view.poll()
    finally:
        view.finish()
        viewer.close()
    refused = f", {view.refused} of another build left out" if view.refused else ""
    print(f"{view.messages} messages of {view.runs} run(s) shown{refused}")
    return 0


def main() -> None:
    sys.exit(run_node("rerun_node", OPTIONS, _body))
