# SPDX-License-Identifier: Apache-2.0
"""Finds the definition of a message: that of the standard table, the one stored beside the machine, the installed one.

A machine's *stored* definitions (`lander.json` has `lander.interfaces.json`) let it compile without ROS 2. Where a
definition is both stored and installed, they must be equal.
"""

from __future__ import annotations

import contextlib
import difflib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..base.diagnostics import nearest
from ..base.files import MAX_SOURCE_BYTES, SourceError, read_regular
from ..base.json_file import json_value
from ..base.packages import PackageNotFound, package_share
from .definition_text import EMPTY, Definition, DefinitionError, declarations, read_definition
from .standard_messages import CONSTANTS, SIZES, STANDARD, Constant, Definitions, Member, full_name, short_name

#: Most bytes of a message, without its strings and unbounded lists.
MAX_BYTES = 65536
#: Messages within one another, and fields of all of them.
_MAX_DEPTH, _MAX_FIELDS = 16, 65536
_BYTES = ("uint8", "int8", "byte", "char")

#: Definitions as lines that declare, by full name.
Texts = Mapping[str, Sequence[str]]


class InterfaceError(ValueError):
    """A message that no channel can be mapped to. args: message text, help text."""


class NoInterface(InterfaceError):
    """There is no definition of it."""


@dataclass(frozen=True)
class Interfaces:
    """A message and all that it contains: their members, their constants, and the texts of those that are not standard."""

    members: Definitions
    constants: Mapping[str, Mapping[str, Constant]]
    texts: Texts = field(default_factory=dict)


#: The standard messages.
STANDARD_INTERFACES = Interfaces(STANDARD, CONSTANTS)


def stored_path(config: Path) -> Path:
    """Where the definitions of a machine's messages are stored."""
    return config.with_suffix(".interfaces.json")


def definition_files(messages: Iterable[str], config: Path) -> list[Path]:
    """The files that have the definitions of these messages (full names), which are not standard: stored and installed."""
    found = [stored_path(config)] if (names := list(messages)) else []
    for message in names:
        package, _, name = message.split("/")
        with contextlib.suppress(PackageNotFound):
            found.append(package_share(package) / "msg" / f"{name}.msg")
    return [path for path in found if path.is_file()]


def find_interfaces(type_: str, config: Path) -> Interfaces:
    """The definition of a message ("package/Type") that `config` names. Raises InterfaceError."""
    message = full_name(type_)
    if message in STANDARD:
        return STANDARD_INTERFACES
    stored = stored_texts(stored_path(config))
    if message not in stored:
        texts = installed_texts([message])
    else:
        texts = _closure([message], lambda name: _stored(name, stored, config))
        _compare(texts, config)
    found = _read(message, texts)
    _check(message, found)
    return found


def stored_texts(path: Path) -> Texts:
    """What is stored in a file; nothing where there is none. Raises InterfaceError."""
    try:
        data = json_value(read_regular(path, MAX_SOURCE_BYTES))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, SourceError) as error:
        raise InterfaceError(f"{path.name} cannot be read: {error}", "write it again with `fcsl interfaces`") from None
    if not isinstance(data, dict) or not all(
        isinstance(lines, list) and all(isinstance(line, str) for line in lines) for lines in data.values()
    ):
        raise InterfaceError(f"{path.name} is not what `fcsl interfaces` writes", "write it again")
    return {full_name(name): lines for name, lines in data.items()}


def stored_text(texts: Texts) -> str:
    """The file of these definitions."""
    rows = {short_name(name): list(texts[name]) for name in sorted(texts)}
    return json.dumps(rows, indent=2) + "\n"


def installed_texts(messages: Iterable[str]) -> Texts:
    """The definitions of messages (full names) and of all that they contain, as they are installed, without the standard
    ones. Raises InterfaceError."""
    return _closure(messages, _installed)


def _closure(messages: Iterable[str], text_of: Callable[[str], Sequence[str]]) -> Texts:
    texts: dict[str, Sequence[str]] = {}
    waiting = [message for message in messages if message not in STANDARD]
    while waiting:
        message = waiting.pop()
        if message in texts:
            continue
        texts[message] = text_of(message)
        for member in _definition(message, texts[message]).members:
            if "/" in member.type and member.type not in STANDARD:
                waiting.append(member.type)
    return texts


def _definition(message: str, lines: Sequence[str]) -> Definition:
    try:
        return read_definition(message, "\n".join(lines))
    except DefinitionError as error:
        text = f"the definition of `{short_name(message)}` is not valid: {error}"
        raise InterfaceError(text, "mend its .msg file") from None


def _installed(message: str) -> Sequence[str]:
    package, _, name = message.split("/")
    try:
        folder = package_share(package) / "msg"
    except PackageNotFound:
        text = f"`{short_name(message)}`: package `{package}` is not installed"
        raise NoInterface(text, "source the workspace that has it, or store it with `fcsl interfaces` there") from None
    try:
        return declarations(read_regular(folder / f"{name}.msg", MAX_SOURCE_BYTES).decode())
    except FileNotFoundError:
        names = sorted(path.stem for path in folder.glob("*.msg"))
        close = nearest(name, names) or (f"there are {', '.join(names[:24])}" if names else "it has no messages")
        raise NoInterface(f"package `{package}` has no message `{name}`", close) from None
    except (OSError, ValueError, SourceError) as error:
        raise InterfaceError(f"{folder / name}.msg cannot be read: {error}", "install its package again") from None


def _stored(message: str, stored: Texts, config: Path) -> Sequence[str]:
    if message not in stored:
        text = f"{stored_path(config).name} does not have `{short_name(message)}`"
        raise InterfaceError(text, f"write it again with `fcsl interfaces {config.name}`")
    return stored[message]


def _compare(stored: Texts, config: Path) -> None:
    """Refuses definitions that are installed, too, in another form. Raises InterfaceError."""
    for message, lines in stored.items():
        try:
            package_share(message.partition("/")[0])
        except PackageNotFound:
            continue
        installed = _installed(message)
        if list(installed) != list(lines):
            changes = [line for line in difflib.ndiff(list(lines), list(installed)) if line.startswith(("- ", "+ "))]
            text = (
                f"the stored definition of `{short_name(message)}` is not the installed one: {'; '.join(changes[:8])}"
            )
            fix = f"take the installed one with `fcsl interfaces {config.name}`, or source the workspace of the stored one"
            raise InterfaceError(text, fix)


def _read(message: str, texts: Texts) -> Interfaces:
    members, constants = dict(STANDARD), dict(CONSTANTS)
    for name, lines in texts.items():
        definition = _definition(name, lines)
        members[name], constants[name] = definition.members, definition.constants
    _fields(message, members, {})
    return Interfaces(members, constants, dict(texts))


def _fields(message: str, members: Definitions, known: dict[str, int], depth: int = 0) -> int:
    """The number of fields of a message and of all in it. Raises InterfaceError where they would be too many to look at."""
    if depth > _MAX_DEPTH:
        raise InterfaceError(f"`{short_name(message)}` contains itself, or is nested too deeply", "map another message")
    if message not in known:
        known[message] = sum(
            _fields(member.type, members, known, depth + 1) if "/" in member.type else 1 for member in members[message]
        )
    if known[message] > _MAX_FIELDS:
        raise InterfaceError(f"`{short_name(message)}` has more than {_MAX_FIELDS} fields", "map another message")
    return known[message]


def _check(message: str, found: Interfaces) -> None:
    """Refuses what channels are not for. Raises InterfaceError."""
    if found.members[message] == (EMPTY,):
        raise InterfaceError(f"`{short_name(message)}` has no fields", "map a message of numbers")
    for path, member in _leaves(message, found.members, ""):
        what = f"`{short_name(message)}` contains `{path}`"
        if member.type == "wstring":
            raise InterfaceError(f"{what}, a wstring, which is not read", "map another message")
        if member.type in _BYTES and member.sequence and not member.bound:
            why = "an unbounded list of bytes: bulk data"
            fix = "let a node of yours reduce it to a message of numbers, and map that"
            raise InterfaceError(f"{what}, {why}", fix)
    size = _least_bytes(message, found.members)
    if size > MAX_BYTES:
        fix = "let a node of yours reduce it to a message of numbers, and map that"
        raise InterfaceError(f"a `{short_name(message)}` has {size} bytes; channels carry {MAX_BYTES}", fix)


def _leaves(message: str, members: Definitions, prefix: str) -> Iterable[tuple[str, Member]]:
    for member in members[message]:
        if member.type in members:
            yield from _leaves(member.type, members, f"{prefix}{member.name}.")
        else:
            yield prefix + member.name, member


def _least_bytes(message: str, members: Definitions) -> int:
    total = 0
    for member in members[message]:
        one = SIZES.get(member.type) or (_least_bytes(member.type, members) if member.type in members else 4)
        total += one * (member.bound or 0 if member.sequence else max(1, member.count))
    return total
