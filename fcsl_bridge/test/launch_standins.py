# SPDX-License-Identifier: Apache-2.0
"""Test doubles of the parts of `launch` and `launch_ros` (Jazzy) that the launch files use, which no package index has.

They check the rules that a launch file can break: the arguments of an action, that a required launch argument is given,
that a choice is valid, that an included file gets its required arguments from the including action. Nothing is started:
`visit` returns the nodes that would be.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any


class Context:
    """The current launch configurations and environment variables, all of them strings."""

    def __init__(self, **given: str):
        self.launch_configurations = dict(given)
        self.environment: dict[str, str] = {}


class LaunchDescription:
    def __init__(self, initial_entities: Iterable[Any] | None = None):
        self.entities = list(initial_entities or ())


class LaunchConfiguration:
    def __init__(self, variable_name: str, *, default: str | None = None):
        self.name, self.default = variable_name, default

    def perform(self, context: Context) -> str:
        value = context.launch_configurations.get(self.name, self.default)
        if value is None:
            raise RuntimeError(f"launch configuration '{self.name}' does not exist")
        return value


class DeclareLaunchArgument:
    def __init__(
        self,
        name: str,
        *,
        default_value: str | None = None,
        description: str | None = None,
        choices: list[str] | None = None,
    ):
        assert default_value is None or isinstance(default_value, str)
        self.name, self.default_value, self.description, self.choices = name, default_value, description, choices

    def visit(self, context: Context) -> list[Any]:
        given = context.launch_configurations
        if self.name not in given and self.default_value is None:
            raise RuntimeError(f'Required launch argument "{self.name}" was not provided.')
        given.setdefault(self.name, self.default_value or "")
        if self.choices is not None and given[self.name] not in self.choices:
            raise RuntimeError(f'Argument "{self.name}" provided value "{given[self.name]}" is not valid')
        return []


class SetEnvironmentVariable:
    def __init__(self, name: str, value: str):
        self.name, self.value = name, value

    def visit(self, context: Context) -> list[Any]:
        context.environment[self.name] = self.value
        return []


class Shutdown:
    def __init__(self, *, reason: str = "reason not given"):
        self.reason = reason


class OpaqueFunction:
    def __init__(self, *, function: Callable[..., Any], args: Any = None, kwargs: Any = None):
        self.function, self.args, self.kwargs = function, args or (), kwargs or {}

    def visit(self, context: Context) -> list[Any]:
        return list(self.function(context, *self.args, **self.kwargs) or ())


class PythonLaunchDescriptionSource:
    def __init__(self, launch_file_path: str):
        assert isinstance(launch_file_path, str)
        self.path = launch_file_path


class IncludeLaunchDescription:
    def __init__(self, launch_description_source: Any, *, launch_arguments: Iterable[tuple[str, Any]] | None = None):
        self.source = launch_description_source
        self.arguments = dict(launch_arguments or ())

    def visit(self, context: Context) -> list[Any]:
        description = load_launch_file(Path(self.source.path)).generate_launch_description()
        for entity in description.entities:
            if isinstance(entity, DeclareLaunchArgument) and entity.default_value is None:
                assert entity.name in self.arguments, f"Included launch description missing required argument {entity}"
        for name, value in self.arguments.items():
            text = value.perform(context) if isinstance(value, LaunchConfiguration) else value
            context.launch_configurations[name] = text
        return list(description.entities)


class ParameterValue:
    def __init__(self, value: str, *, value_type: type | None = None):
        self.value, self.value_type = value, value_type


class Node:
    def __init__(
        self,
        *,
        executable: str,
        package: str | None = None,
        name: str | None = None,
        namespace: str | None = None,
        parameters: list[dict[str, Any]] | None = None,
        output: str = "log",
        on_exit: Any = None,
    ):
        self.executable, self.package, self.namespace, self.on_exit = executable, package, namespace, on_exit
        self.parameters = {key: value for each in parameters or () for key, value in each.items()}

    def visit(self, context: Context) -> list[Any]:
        return []


_MODULES = {
    "launch": (LaunchDescription,),
    "launch.actions": (
        DeclareLaunchArgument,
        IncludeLaunchDescription,
        OpaqueFunction,
        SetEnvironmentVariable,
        Shutdown,
    ),
    "launch.launch_description_sources": (PythonLaunchDescriptionSource,),
    "launch.substitutions": (LaunchConfiguration,),
    "launch_ros": (),
    "launch_ros.actions": (Node,),
    "launch_ros.parameter_descriptions": (ParameterValue,),
}


def modules() -> dict[str, ModuleType]:
    """The doubles as modules for sys.modules."""
    made = {name: ModuleType(name) for name in _MODULES}
    for name, members in _MODULES.items():
        for member in members:
            setattr(made[name], member.__name__, member)
    return made


def load_launch_file(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def visit(path: Path, **arguments: str) -> tuple[list[Node], Context]:
    """The nodes that launching the file with these arguments would start."""
    context = Context(**arguments)
    nodes: list[Node] = []
    pending = list(load_launch_file(path).generate_launch_description().entities)
    while pending:
        entity = pending.pop(0)
        if isinstance(entity, Node):
            nodes.append(entity)
        pending[:0] = entity.visit(context)
    return nodes, context
