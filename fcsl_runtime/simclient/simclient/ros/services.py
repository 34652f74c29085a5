# SPDX-License-Identifier: Apache-2.0
"""The services of a machine's `ros` blocks: calls become samples of a channel, and what the machine then does answers them."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from ctypes import Structure, byref, c_char, c_uint8
from typing import NamedTuple

from ..c_run import CError
from ..descriptor import Service
from ..errors import TwinError
from ..run import Run
from . import native


class Answer(NamedTuple):
    """The response of std_srvs/srv/Trigger and SetBool."""

    success: bool
    message: str


class _CAnswer(Structure):
    """fcsl_service_answer_t"""

    _fields_ = [("success", c_uint8), ("message", c_char * 256)]

    @property
    def answer(self) -> Answer:
        return Answer(bool(self.success), self.message.decode("utf-8", "replace"))


class ServiceInput:
    """Delivers the calls of a service to a run, one after another; of each tick: prepare, call, the tick, poll. `now_ns`: the
    stamp of samples."""

    def __init__(self, run: Run, service: Service):
        """Raises TwinError."""
        self._run, self._library = run, native.library()
        error = CError()
        number = run.machine.services.index(service)
        self._handle = self._library.fcsl_service_input_new(run.handle(), number, byref(error))
        if not self._handle:
            raise TwinError(error.text.decode("utf-8", "replace"))
        weakref.finalize(self, self._library.fcsl_service_input_free, self._handle)

    def begin(self, now_ns: int) -> None:
        """Ticks follow: no call waits, and the channel has a sample for the coming one."""
        self._run.handle()
        self._library.fcsl_service_input_begin(self._handle, now_ns)

    def prepare(self, now_ns: int) -> bool:
        """Before a tick: whether calls may be taken. Not where a tick has to see first that the last one is over."""
        self._run.handle()
        return bool(self._library.fcsl_service_input_prepare(self._handle, now_ns))

    def call(self, value: bool, now_ns: int) -> Answer | None:
        """A call, for the coming tick; `value`: that of a SetBool. None: it waits; else another one does."""
        self._run.handle()
        answer = _CAnswer()
        waits = self._library.fcsl_service_input_call(self._handle, int(value), now_ns, byref(answer)) == 0
        return None if waits else answer.answer

    def poll(self) -> Answer | None:
        """After a tick: the answer of the call that waits, once it has one."""
        return self._ended(self._library.fcsl_service_input_poll)

    def end(self) -> Answer | None:
        """No tick follows: the answer of the call that waits, if one does."""
        return self._ended(self._library.fcsl_service_input_end)

    def _ended(self, function: Callable[..., int]) -> Answer | None:
        self._run.handle()
        answer = _CAnswer()
        return answer.answer if function(self._handle, byref(answer)) else None
