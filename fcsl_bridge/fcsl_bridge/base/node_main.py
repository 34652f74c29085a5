# SPDX-License-Identifier: Apache-2.0
"""Common code of the bridge's nodes: start and end of the process, signals, parameters, waiting."""

from __future__ import annotations

import difflib
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy._rclpy_pybind11 import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.duration import Duration
from rclpy.exceptions import InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from fcsl_compiler.api.command_line import package_version
from fcsl_compiler.api.diagnostics import DiagnosticError
from fcsl_compiler.api.packages import PackageNotFound
from fcsl_sim.errors import SimError
from simclient.errors import MapError, TwinError, ViewError
from simclient.exit_within import exit_within

from ..errors import BridgeError, Stopped
from ..loopback import loopback_environment
from .node_logger import NodeLogger

_MATCH_POLL_S = 0.02
#: How long the end of a node waits for those who listen to /rosout.
_LAST_WORDS_S = 2.0
#: How long ROS may take to remove a node, in s.
_DESTROY_S = 5.0
#: Parameters that rclpy itself declares.
_DESCRIBES_TYPES = "start_type_description_service"
_ROS_PARAMETERS = ("use_sim_time", _DESCRIBES_TYPES, "qos_overrides")
#: Errors of input or environment; str() is the complete message.
BAD_INPUT = (BridgeError, TwinError, MapError, ViewError, SimError, PackageNotFound)
_ROS_ERRORS = (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError)
_NAME_ERRORS = (InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException)


@dataclass(frozen=True)
class Option:
    """A node parameter of type `kind`. Without a default (None) the node has it where it is given.

    `settable`: may be set while the node runs, and the node handles that; others are read-only.
    """

    name: str
    kind: type
    default: Any
    doc: str
    settable: bool = False


class Stop:
    """Records SIGINT and SIGTERM. rclpy's own handlers would shut the context down during a publish."""

    def __init__(self) -> None:
        self.signal = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.signal = number

    def check(self) -> None:
        """Raises Stopped once a signal has arrived."""
        if self.signal:
            raise Stopped


def run_node(
    name: str,
    options: Sequence[Option],
    body: Callable[[Any, Stop], int],
    kind: type[Node] = Node,
    parameter_services: bool = False,
    called: Callable[[Node], str] | None = None,
) -> int:
    """Runs `body` in a node of class `kind` called `name`; returns the exit status. An error is one message and
    status 1. Without `parameter_services` the parameters hold for the whole run. `called`: another name, which follows
    from the parameters of a node called `name`; `-r __node:=…` wins over both.

    `-h` and `--help` print the options, `--version` name and version, and do nothing else.
    """
    stop = Stop()
    node = logger = None
    status = 1
    try:
        if any(word in ("-h", "--help") for word in sys.argv[1:]):
            print(_help(name, options), flush=True)
            return 0
        if "--version" in sys.argv[1:]:
            print(f"{name} {package_version('fcsl_bridge', __file__)}", flush=True)
            return 0
        _refuse_arguments(sys.argv[1:])
        os.environ.update(loopback_environment(os.environ))
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        # Saves one entity in each wait of the executor.
        given = {_DESCRIBES_TYPES: Parameter(_DESCRIBES_TYPES, value=False)}
        own_name = name
        if called is not None:
            own_name, parameters = _read_arguments(name, called)
            given = parameters | given
        node = kind(
            own_name,
            automatically_declare_parameters_from_overrides=True,
            start_parameter_services=parameter_services,
            parameter_overrides=list(given.values()),
            enable_rosout=False,
        )
        logger = NodeLogger(node)
        ended = body(node, stop)
        sys.stdout.flush()
        status = ended
    except DiagnosticError as error:
        print(error, file=sys.stderr)
        _report(node, name, "the simulation has errors")
    except BAD_INPUT as error:
        _report(node, name, str(error))
    except (*_ROS_ERRORS, *_NAME_ERRORS) as error:
        _report(node, name, f"ROS 2: {' '.join(str(error).split())}")
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        _report(node, name, f"{error.filename or ''}: {error.strerror}")
    finally:
        # The end of one node makes a launch file interrupt the others, which may have just ended, too. Python keeps this
        # until the process is over, but would bring back the default action, death, for a handler of its own.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if logger is not None:
            wait_for_receivers([logger.publisher], _LAST_WORDS_S)
        if node is not None:
            # Fast DDS 2.14 may wait for itself where another node ends at the same time: its callback of a writer that is
            # gone holds what DomainParticipant::set_listener waits for.
            with suppress(OSError):
                sys.stdout.flush()
            try:
                exit_within(_DESTROY_S, status)
            except TwinError as error:
                print(f"{name}: {error}", file=sys.stderr)
            node.destroy_node()
        rclpy.try_shutdown()
    return status


def _read_arguments(name: str, called: Callable[[Node], str]) -> tuple[str, dict[str, Parameter]]:
    """What the node is to be called, and its parameters, which a file may give to `name`."""
    node = Node(
        name,
        automatically_declare_parameters_from_overrides=True,
        start_parameter_services=False,
        enable_rosout=False,
        parameter_overrides=[Parameter(_DESCRIBES_TYPES, value=False)],
    )
    try:
        return called(node), dict(node.get_parameters_by_prefix(""))
    finally:
        node.destroy_node()


def _report(node: Node | None, name: str, text: str) -> None:
    """Says on standard error what ends the process; the logger of a node says it on /rosout, too."""
    if node is None:
        print(f"{name}: error: {text}", file=sys.stderr)
    else:
        node.get_logger().fatal(text)


def _help(name: str, options: Sequence[Option]) -> str:
    lines = [
        f"usage: {name} [--help] [--version] [--ros-args -p NAME:=VALUE ... -r __ns:=/NAMESPACE]",
        "",
        "parameters:",
    ]
    width = max(len(option.name) for option in options)
    for option in options:
        default = "" if option.default in (None, "") else f" (default {option.default})"
        lines.append(f"  {option.name:{width}}  {option.doc}{default}")
    return "\n".join(lines)


def _refuse_arguments(arguments: Sequence[str]) -> None:
    """Raises BridgeError for arguments outside `--ros-args ... --`: a parameter given there must not be ignored.

    rcl itself accepts a bare `name:=value` as a remapping, so that a forgotten `-p` would go unnoticed.
    """
    in_ros_arguments = False
    for word in arguments:
        if word == "--ros-args":
            in_ros_arguments = True
        elif in_ros_arguments:
            in_ros_arguments = word != "--"
        else:
            hint = "parameters are given as --ros-args -p NAME:=VALUE (see --help)"
            raise BridgeError(f"unexpected argument `{word}`; {hint}")


def read_options(node: Node, options: Sequence[Option], dotted: bool = False) -> dict[str, Any]:
    """Declares the options and returns their values by name. Raises BridgeError for a wrong type, and for an unknown
    parameter; with `dotted`, names with a dot are ignored."""
    known = {option.name for option in options}
    for given in node.get_parameters_by_prefix(""):
        if given not in known and given.split(".")[0] not in _ROS_PARAMETERS and not (dotted and "." in given):
            close = difflib.get_close_matches(given, known, n=1, cutoff=0.5)
            hint = f"did you mean `{close[0]}`?" if close else f"there are: {', '.join(sorted(known))}"
            raise BridgeError(f"unknown parameter `{given}`; {hint}")
    return {option.name: _declare(node, option) for option in options}


def take_dotted(node: Node) -> dict[str, Any]:
    """Removes parameters with a dot in their names from the node; returns their values by name."""
    given = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if "." in name and name.split(".")[0] not in _ROS_PARAMETERS
    }
    for name in given:
        node.undeclare_parameter(name)
    return given


def _declare(node: Node, option: Option) -> Any:
    """Declares a parameter that rclpy declared at the start without type and description again, with both."""
    value = option.default
    if node.has_parameter(option.name):
        value = _checked(option, node.get_parameter(option.name).value)
        node.undeclare_parameter(option.name)
    elif value is None:
        return None  # `ros2 param dump` writes a parameter without a value in a way that rcl cannot read
    descriptor = ParameterDescriptor(description=option.doc, read_only=not option.settable)
    node.declare_parameter(option.name, value, descriptor, ignore_override=True)
    return value


def _checked(option: Option, value: Any) -> Any:
    if option.kind is float and type(value) is int:
        return float(value)
    if option.kind is list and value is not None and not isinstance(value, str):
        return list(value)
    if type(value) is not option.kind:
        raise BridgeError(f"parameter `{option.name}` takes {option.doc}; got {value!r}")
    return value


def positive(options: dict[str, Any], *names: str) -> None:
    """Raises BridgeError unless each of these numbers, if given, is finite and above zero."""
    for name in names:
        value = options[name]
        if value is not None and not math.isfinite(value):
            raise BridgeError(f"parameter `{name}` must be finite, got {value}")
        if value is not None and not value > 0:
            raise BridgeError(f"parameter `{name}` must be above zero, got {value}")


def not_negative(options: dict[str, Any], *names: str) -> None:
    """Raises BridgeError unless each of these numbers, if given, is zero or above."""
    for name in names:
        value = options[name]
        if value is not None and not value >= 0:
            raise BridgeError(f"parameter `{name}` must not be negative, got {value}")


def wait_for_receivers(publishers: Iterable[Publisher], timeout_s: float) -> None:
    """Returns once the subscribers of each publisher have all messages, or after `timeout_s` for all of them together."""
    deadline = time.monotonic() + timeout_s
    for publisher in publishers:
        publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))


def wait_for_subscribers(
    publishers: Sequence[Publisher], count: int, timeout_s: float, meanwhile: Callable[[], None]
) -> None:
    """Returns once each publisher has `count` matched subscriptions. Raises BridgeError with those that lack them, and
    what `meanwhile` raises."""
    deadline = time.monotonic() + timeout_s
    reported = False
    while True:
        lacking = [p.topic_name for p in publishers if p.get_subscription_count() < count]
        if not lacking:
            return
        if not reported:
            reported = True
            print(f"waiting for {count} subscribers each on {', '.join(lacking)}", flush=True)
        meanwhile()
        if time.monotonic() > deadline:
            raise BridgeError(f"fewer than {count} subscribers within {timeout_s} s on {', '.join(lacking)}")
        time.sleep(_MATCH_POLL_S)
