# SPDX-License-Identifier: Apache-2.0
"""A client of a controller's lifecycle, parameters and services, as a ROS 2 user's tools."""

from __future__ import annotations

from typing import Any

from bridge_harness import Listener
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import deserialize_message

from fcsl_bridge.topics import qos

CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEANUP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
SHUTDOWN = {
    "unconfigured": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    "inactive": Transition.TRANSITION_INACTIVE_SHUTDOWN,
    "active": Transition.TRANSITION_ACTIVE_SHUTDOWN,
}


class ControllerClient:
    """Calls the services of one controller node through a listener."""

    def __init__(self, listener: Listener, node: str = "/rig"):
        self._listener, self._node = listener, node
        self._clients: dict[str, Any] = {}

    def call(self, service_type: Any, service: str, **fields: Any) -> Any:
        """The answer of <node>/<service>."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self._listener.node.create_client(service_type, f"{self._node}/{service}")
        self._listener.until(client.service_is_ready)
        future = client.call_async(service_type.Request(**fields))
        self._listener.until(future.done)
        return future.result()

    # ---- lifecycle ----

    def change(self, transition: int) -> bool:
        return bool(self.call(ChangeState, "change_state", transition=Transition(id=transition)).success)

    @property
    def state(self) -> str:
        return str(self.call(GetState, "get_state").current_state.label)

    # ---- parameters ----

    def set(self, **values: Any) -> SetParametersResult:
        """One parameter, `__` for each dot in its name."""
        (result,) = self.call(SetParameters, "set_parameters", parameters=_messages(values)).results
        return result

    def set_atomically(self, **values: Any) -> SetParametersResult:
        return self.call(SetParametersAtomically, "set_parameters_atomically", parameters=_messages(values)).result

    def get(self, name: str) -> Any:
        (value,) = self.call(GetParameters, "get_parameters", names=[name]).values
        value = parameter_value_to_python(value)
        return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value

    def names(self) -> list[str]:
        return list(self.call(ListParameters, "list_parameters").result.names)

    def describe(self, name: str) -> ParameterDescriptor:
        (descriptor,) = self.call(DescribeParameters, "describe_parameters", names=[name]).descriptors
        return descriptor

    # ---- diagnostics ----

    def diagnosed(self, count: int = 1) -> list[dict[str, DiagnosticStatus]]:
        """The next `count` messages on /diagnostics: statuses by name."""
        received = self._listener.received.get("/diagnostics")
        if received is None:
            self._listener.subscribe(DiagnosticArray, "/diagnostics", qos.EVENT)
            received = self._listener.received["/diagnostics"]
        before = len(received)
        self._listener.until(lambda: len(received) >= before + count)
        arrays = [deserialize_message(data, DiagnosticArray) for data in received[before : before + count]]
        return [{status.name: status for status in array.status} for array in arrays]


def _messages(values: dict[str, Any]) -> list[Any]:
    return [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()]


def figures(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}
