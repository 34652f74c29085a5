# SPDX-License-Identifier: Apache-2.0
"""`choices` of a mapped value: what the indices 0, 1, … that the machine has stand for in the message."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.diagnostics import nearest
from .interfaces import Interfaces
from .message_fields import FieldError, Kind, owner_of, select
from .rows import Choice
from .standard_messages import SIZES, short_name

_MOST = 256


def resolve(found: Interfaces, message: str, field: str, choices: Sequence[Choice]) -> tuple[Choice, ...]:
    """The texts of a string, or the numbers of a field of integers, of which names of constants may be written. Raises
    FieldError."""
    if not choices:
        return ()
    owner, member = owner_of(found.members, message, field)
    selection = select(found.members, message, field)
    if len(choices) > _MOST:
        raise FieldError(f"{len(choices)} choices", f"there may be {_MOST}")
    if selection.kind is Kind.TEXT:
        resolved = [_text(choice, member.text_bound, field) for choice in choices]
    elif (
        SIZES.get(member.type)
        and not member.type.startswith("float")
        and member.type != "bool"
        and not selection.is_length
    ):
        resolved = [_number(choice, found, owner, member.type) for choice in choices]
    else:
        raise FieldError(f"`choices` of `{field}`, which is neither a string nor an integer", "remove `choices`")
    for i, choice in enumerate(resolved):
        if choice in resolved[:i]:
            raise FieldError(f"`choices` has `{choice}` twice", "give each index its own")
    return tuple(resolved)


def _text(choice: Choice, bound: int, field: str) -> Choice:
    if not isinstance(choice, str):
        raise FieldError(f"`choices` has {choice}, and `{field}` is a string", f'write "{choice}"')
    if "\0" in choice or (bound and len(choice.encode()) > bound):
        raise FieldError(f"`{field}` cannot be `{choice}`", f"it has at most {bound} characters" if bound else "no NUL")
    return choice


def _number(choice: Choice, found: Interfaces, owner: str, type_: str) -> Choice:
    number: object = choice
    if isinstance(choice, str):
        constants = found.constants.get(owner, {})
        if choice not in constants:
            names = [name for name, value in constants.items() if isinstance(value, int)]
            known = f"its constants are {', '.join(names[:24])}" if names else "it has no constants; write numbers"
            raise FieldError(f"`{short_name(owner)}` has no constant `{choice}`", nearest(choice, names) or known)
        number = constants[choice]
    bits = 8 * SIZES[type_]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if type_.startswith("int") else (0, (1 << bits) - 1)
    if not isinstance(number, int) or not low <= number <= min(high, (1 << 63) - 1):
        raise FieldError(f"`{choice}` does not fit {type_}", f"write a number from {low} to {high}")
    return number
