# SPDX-License-Identifier: Apache-2.0
"""NXP PCA9685 on i2c-stub: sixteen PWM outputs, which are read back from its registers."""

from __future__ import annotations

from pathlib import Path

from .chips import Chip


class Pca9685(Chip):
    """One period for all channels. The driver's write to "all outputs" reaches no single output here, so `reset` does what it would."""

    NAME = "pca9685"
    ADDRESS = 0x41
    CHANNELS = 16
    _MODE1, _LEDS, _PRESCALE = 0x00, 0x06, 0xFE
    _SLEEP, _FULL = 0x10, 0x10
    _STEPS, _OSCILLATOR_HZ = 4096, 25e6

    def reset(self) -> None:
        self._write(self._MODE1, bytes([0x11, 0x04]))
        self._write(self._PRESCALE, b"\x1e")
        for channel in range(self.CHANNELS):
            self._write(self._LEDS + 4 * channel, bytes([0, 0, 0, self._FULL]))

    @property
    def pwmchip(self) -> Path:
        return next((self._bus.device(self.address) / "pwm").glob("pwmchip*"))

    @property
    def period(self) -> float:
        """In s."""
        return self._STEPS * (self._read(self._PRESCALE) + 1) / self._OSCILLATOR_HZ

    @property
    def asleep(self) -> bool:
        """Whether the oscillator stands still: no output has pulses then."""
        return bool(self._read(self._MODE1) & self._SLEEP)

    def pulses(self) -> list[float]:
        """The time in s for which each output is high in a period; 0 where it is off."""
        if self.asleep:
            return [0.0] * self.CHANNELS
        step = self.period / self._STEPS
        half = 2 * self.CHANNELS  # registers in one transfer
        registers = b"".join(self._bus.read(self.address, self._LEDS + first, half) for first in (0, half))
        return [self._high_steps(registers[4 * channel : 4 * channel + 4]) * step for channel in range(self.CHANNELS)]

    def _high_steps(self, registers: bytes) -> int:
        on_low, on_high, off_low, off_high = registers
        if off_high & self._FULL:
            return 0
        if on_high & self._FULL:
            return self._STEPS
        on, off = on_low | (on_high & 0xF) << 8, off_low | (off_high & 0xF) << 8
        return (off - on) % self._STEPS
