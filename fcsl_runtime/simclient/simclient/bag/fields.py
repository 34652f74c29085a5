# SPDX-License-Identifier: Apache-2.0
"""Fields of decoded messages by path."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import reduce
from typing import TYPE_CHECKING, Any

from ..errors import BagError, did_you_mean

if TYPE_CHECKING:
    from .bag import Topic


def field_value(topic: Topic, message: Any, field: str) -> Any:
    """`message.<field>` for a path such as `pose.position` or `targets[2].pose`. Raises BagError listing the fields."""
    try:
        if not _FIELD_PATH.fullmatch(field):
            raise AttributeError(field)
        return reduce(_step, _FIELD_STEP.findall(field), message)
    except (AttributeError, IndexError, TypeError):
        names = leaf_names(message)
        hint = did_you_mean(field, names)
        raise BagError(
            f"`{topic.name}` [{topic.type}] has no field `{field}`{hint}; fields: {', '.join(names)}"
        ) from None


_FIELD_STEP = re.compile(r"\[\d+\]|[^.\[\]]+")
_FIELD_PATH = re.compile(r"[^.\[\]]+(\[\d+\])*(\.[^.\[\]]+(\[\d+\])*)*")


def _step(value: Any, step: str) -> Any:
    return value[int(step[1:-1])] if step.startswith("[") else getattr(value, step)


def leaf_names(message: Any, prefix: str = "") -> list[str]:
    """Paths of every field of a decoded message, in order; of an array of messages, those of the first."""
    names = []
    for name in message.__dataclass_fields__:
        if name == "__msgtype__":
            continue
        value = getattr(message, name)
        if hasattr(value, "__msgtype__"):
            names += leaf_names(value, f"{prefix}{name}.")
        elif isinstance(value, list) and value and hasattr(value[0], "__msgtype__"):
            names += leaf_names(value[0], f"{prefix}{name}[0].")
        else:
            names.append(prefix + name)
    return names


def flat(message: Any, prefix: str = "", most: int | None = None) -> Iterator[tuple[str, Any]]:
    """(path, value) of every leaf of a decoded message; messages in sequences one by one, arrays of numbers whole.

    Sequences of more than `most` messages are whole, too.
    """
    for name in message.__dataclass_fields__:
        if name == "__msgtype__":
            continue
        value = getattr(message, name)
        if hasattr(value, "__msgtype__"):
            yield from flat(value, f"{prefix}{name}.", most)
        elif (
            isinstance(value, list) and value and hasattr(value[0], "__msgtype__") and (not most or len(value) <= most)
        ):
            for i, item in enumerate(value):
                yield from flat(item, f"{prefix}{name}[{i}].", most)
        else:
            yield prefix + name, value
