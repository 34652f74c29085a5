# SPDX-License-Identifier: Apache-2.0
"""C of `step` and `force_state`: the state takes force, channels age, and the tick of the state runs."""

from __future__ import annotations

from .c_writer import CWriter
from .emit_header import channel_member, sensors, state_constant
from .emit_tick import TickEmitter
from .machine import Channel, Machine


class StepEmitter:
    """Writes what the descriptor offers to run a machine, callees first."""

    def __init__(self, machine: Machine, writer: CWriter):
        self.m, self.w = machine, writer

    def emit(self) -> None:
        self._stale()
        TickEmitter(self.m, self.w).emit()
        self._step()
        self._force_state()

    def _stale(self) -> None:
        w, m = self.w, self.m
        w.line("/* On entering a state: nothing has run in it yet. */")
        w.line(f"static __attribute__((cold, noinline)) void fcsl_all_stale_{m.name}({m.name}_t *m)")
        w.open_body()
        for instance in m.instances:
            w.line(f"m->i_{instance.name}.outputs.health = FCSL_STALE;")
        w.close()
        w.line()

    def _step(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_step_{m.name}(void *machine, const fcsl_host_t *host)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        with w.braces("if (m->state_ != m->next_state_)"):
            w.line("m->state_ = m->next_state_;")
            w.line(f"fcsl_all_stale_{m.name}(m);")
        for channel in sensors(m):
            self._age(channel)
        w.open("switch (m->state_)")
        for index, state in enumerate(m.states):
            w.line(f"case {state_constant(m, index)}:")
            w.line(f"    fcsl_tick_{m.name}_{state.name}(m, host);")
            w.line("    break;")
        w.line("default:")
        w.line("    break;")
        w.close()
        w.line("m->tick += 1u;")
        w.close()
        w.line()

    def _age(self, channel: Channel) -> None:
        """A sample makes a channel as old as it is itself; without one it ages. It is valid until it is too old."""
        w, c = self.w, f"m->{channel_member(channel)}"
        w.open(f"if ({c}.fresh != 0u)")
        w.line(f"{c}.fresh = 0u;")
        w.line(f"{c}.age_ticks = {c}.sample_age;")
        w.line(
            f"{c}.valid = {'1u' if channel.max_age_ticks is None else f'{c}.age_ticks <= {channel.max_age_ticks}u'};"
        )
        w.reopen(f"else if ({c}.attached != 0u && {c}.age_ticks < UINT32_MAX)")
        w.line(f"{c}.age_ticks += 1u;")
        if channel.max_age_ticks is not None:
            w.line(f"{c}.valid = {c}.age_ticks <= {channel.max_age_ticks}u;")
        w.close()

    def _force_state(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_force_state_{m.name}(void *machine, int32_t state)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        w.line("m->state_ = state;")
        w.line("m->next_state_ = state;")
        w.line(f"fcsl_all_stale_{m.name}(m);")
        w.close()
        w.line()
