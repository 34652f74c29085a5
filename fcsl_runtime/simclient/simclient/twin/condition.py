# SPDX-License-Identifier: Apache-2.0
"""Conditions on a twin: a function, or an expression over paths.

nav.outputs.P[0][0] < 1e-3 and machine.state in ('COAST', 'DESCENT')
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import TwinError

if TYPE_CHECKING:
    from .host import TwinHost


class Condition:
    """Callable that returns whether the condition holds now; `read` lists the values it used.

    Raises TwinError if invalid.
    """

    def __init__(self, condition: str | Callable[[Any], bool], twin: Any):
        self._twin: TwinHost = twin
        if isinstance(condition, str):
            self._text = f"`{condition}`"
            self._holds = self._compiled(condition, twin)
        elif callable(condition):
            self._text = getattr(condition, "__name__", repr(condition))
            self._holds = lambda: condition(twin)
        else:
            raise TwinError(
                f"{condition!r} is not a condition; write an expression as a text, or a function of the twin"
            )
        self._reads: dict[str, Any] = {}

    def _compiled(self, text: str, twin: Any) -> Callable[[], Any]:
        from fcsl_compiler.api.expressions import SCALARS, ExpressionError, evaluator, parse  # here: few twins need it

        from ..quantities import quantity

        machine, get = twin.machine, twin.get_value
        try:
            value = evaluator(parse(text, lambda path: quantity(path, machine), condition=True), SCALARS)
        except ExpressionError as error:
            raise TwinError(f"`{text}` is not a condition: {error}. For more give a function: lambda twin: …") from None

        def now() -> Any:
            try:
                return value(lambda leaf: get(leaf.value))
            except ExpressionError as error:
                raise TwinError(f"{self._text} cannot be evaluated: {error}{self.read()}") from None

        return now

    def __call__(self) -> bool:
        self._twin._reads = self._reads = {}
        try:
            holds = self._holds()
        finally:
            self._twin._reads = None
        if not isinstance(holds, bool) and not _is_numpy_bool(holds):
            raise TwinError(f"{self._text} gave {holds!r}; a condition is True or False: let it return a comparison")
        return bool(holds)

    def __str__(self) -> str:
        return self._text

    def read(self) -> str:
        """The values used by the last evaluation, one per line with unit; empty if there are none."""
        fields = self._twin.machine.fields
        return "".join(
            f"\n  {path} = {value!r}" + (f" {fields[path].unit}" if path in fields and fields[path].unit else "")
            for path, value in self._reads.items()
        )


def _is_numpy_bool(value: Any) -> bool:
    import numpy as np  # imported here, because it takes long to load

    return isinstance(value, np.bool_)
