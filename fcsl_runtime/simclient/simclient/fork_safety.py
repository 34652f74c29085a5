# SPDX-License-Identifier: Apache-2.0
"""Resources that a forked process must leave to its parent: a bag has one writer, a socket one client."""

from __future__ import annotations

import os
import weakref
from typing import Protocol

#: Error message of a twin in a forked process.
FORKED = "the twin belongs to the process that this one was forked from; open one in this process"


class _Parents(Protocol):
    def leave_to_parent(self) -> None:
        """Called in the child: becomes unusable and leaves what it shares with the parent unchanged."""


_PARENTS: weakref.WeakSet[_Parents] = weakref.WeakSet()


def not_for_children(one: _Parents) -> None:
    """From now on a forked process cannot use `one`."""
    _PARENTS.add(one)


def for_children(one: _Parents) -> None:
    """Ends the effect of `not_for_children`."""
    _PARENTS.discard(one)


def _in_a_child() -> None:
    for one in list(_PARENTS):
        one.leave_to_parent()


os.register_at_fork(after_in_child=_in_a_child)
