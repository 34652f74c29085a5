"""Lights an LED while the processor is hotter than a limit; without a reading the LED is dark and the guard has failed."""

from fcsl_builtins import Health, extern, f64, hw_write_gpio, i32, isnan


@extern(header="cpu_temp.h", lang="c")
def cpu_temp_c() -> f64:
    """Temperature of the processor in degrees Celsius; NaN when it cannot be read."""
    ...


class Parameters:
    limit_c: "f64 degC"
    led_pin: i32


class Outputs:
    temperature_c: "f64 degC"
    hot: bool


def execute(p: Parameters, y: Outputs) -> None:
    y.temperature_c = cpu_temp_c()
    y.hot = y.temperature_c > p.limit_c  # a NaN exceeds nothing
    if isnan(y.temperature_c):
        y.health = Health.failed
    hw_write_gpio(p.led_pin, y.hot)
