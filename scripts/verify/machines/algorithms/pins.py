"""Hardware, in both directions."""

from fcsl_builtins import f64, hw_read_adc, hw_read_counter, hw_read_gpio, hw_write_gpio, hw_write_pwm, i64


class Outputs:
    level: bool
    volts: f64
    count: i64


def execute(y: Outputs) -> None:
    y.level = hw_read_gpio(3)
    y.volts = hw_read_adc(1)
    y.count = hw_read_counter(0)
    hw_write_gpio(4, not y.level)
    hw_write_pwm(2, y.volts / 3.0)
