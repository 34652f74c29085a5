# SPDX-License-Identifier: Apache-2.0
"""The status of a run: values and health, read from its variable server."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from ..c_machine import HEALTH_NAMES
from ..vars.client import VarClient
from ..vars.wire import VarError
from .http_error import HttpError, of_variables
from .limits import END_TIMEOUT_S, PATHS, STALLED_S, STATUS_TIMEOUT_S
from .runs import Run
from .windows import cut

#: Of the instances that run, from good to bad.
_RUNNING = ("nominal", "degraded", "failed")


def client_of(run: Run) -> VarClient:
    """A connection to the run's variable server. Raises HttpError if there is none."""
    if run.status != "running":
        raise HttpError(409, "not_running", f"run {run.name} is {run.status}", f"GET /runs/{run.name}")
    try:
        return VarClient(run.socket, timeout_s=STATUS_TIMEOUT_S)
    except VarError as error:
        raise of_variables(error) from None


def values(run: Run, paths: Sequence[str]) -> dict[str, Any]:
    """`tick` (ticks completed), and `values` by path, all from the same tick. Raises HttpError.

    For an ended run: the last values of its telemetry.
    """
    if run.status == "ended":
        return _last_values(run, paths)
    with client_of(run) as client:
        try:
            reply = client.get("machine.tick", *paths)
        except VarError as error:
            raise of_variables(error) from None
    return {"tick": reply["machine.tick"], "values": {path: reply[path] for path in paths}}


def _last_values(run: Run, paths: Sequence[str]) -> dict[str, Any]:
    window = cut(run.telemetry, paths, 1)
    if not len(window.rows):
        raise HttpError(409, "no_telemetry", f"no tick of run {run.name} was sent")
    found = {
        path: {rest: window.rows[leaf.path][-1].tolist() for rest, leaf in leaves.items()}
        for path, leaves in window.selected.items()
    }
    values = {path: value.get("", value) for path, value in found.items()}
    return {"tick": int(window.rows.tick[-1]) + 1, "values": values}


def health(run: Run) -> dict[str, Any]:
    """`health` (the worst; or `stalled`, `ended`, ...), and whether it is `ok`. Never raises."""
    if run.status != "running":
        return {"ok": False, "health": run.status}
    try:
        with client_of(run) as client:
            hertz, instances = _machine(client)
            status = client.state()
            found = _healths(client, instances)
    except (VarError, HttpError) as error:
        # A program that ends closes its socket first.
        if error.code in ("unreachable", "closed", "not_running") and run.child.ended.wait(END_TIMEOUT_S):
            return {"ok": False, "health": run.status}
        return {"ok": False, "health": "unresponsive", "message": error.message}
    # `stale` is normal for an instance that the active state does not schedule.
    running = [health for health in found.values() if health != "stale"]
    worst = max(running, key=_RUNNING.index, default="stale" if found else "nominal")
    stalled = _stalled(run, status, 1 / (hertz * (run.options.get("speed") or 1)))
    return {
        "ok": worst != "failed" and not stalled,
        "health": "stalled" if stalled else worst,
        "instances": found,
        **{name: status[name] for name in ("tick", "state", "paused")},
    }


def requirements(run: Run) -> dict[str, Any]:
    """Verdicts so far by id, as `stats` of the variable server has them; {} without requirements. Raises HttpError."""
    return _stats(run, "requirements")


def events(run: Run) -> dict[str, Any]:
    """How many events the algorithms reported, and the `last` of them, as `stats` of the variable server has them; {} for a
    machine that reports none. Raises HttpError."""
    return _stats(run, "events")


def times(run: Run) -> dict[str, Any]:
    """How long its instances took so far, as `stats` of the variable server has it; {} if the machine is not measured.
    Raises HttpError."""
    return _stats(run, "times")


def _stats(run: Run, member: str) -> dict[str, Any]:
    with client_of(run) as client:
        try:
            found: dict[str, Any] = client.stats().get(member, {})
        except VarError as error:
            raise of_variables(error) from None
    return found


def worst_number(name: str) -> int:
    """0 nominal, 1 degraded, 2 failed, 3 stale, as in messages; 4 anything else."""
    return HEALTH_NAMES.index(name) if name in HEALTH_NAMES else len(HEALTH_NAMES)


def _machine(client: VarClient) -> tuple[int, Sequence[str]]:
    described = client.describe()
    return described["tick_hz"], described["instances"]


def _healths(client: VarClient, instances: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for first in range(0, len(instances), PATHS):
        some = instances[first : first + PATHS]
        reply = client.get(*(f"{name}.outputs.health" for name in some))
        found.update(zip(some, reply.values(), strict=True))
    return found


def _stalled(run: Run, status: dict[str, Any], period_s: float) -> bool:
    tick, now = status["tick"], time.monotonic()
    if status["paused"] or tick != run.moved[0]:
        run.moved = (tick, now)
    return now - run.moved[1] > max(STALLED_S, 2 * period_s)
