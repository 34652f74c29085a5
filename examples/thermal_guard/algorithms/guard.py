from fcsl_builtins import extern, f64, hw_write_gpio, isnan


@extern(header="cpu_temp.h")
def cpu_temp_c() -> f64:
    """Temperature of the processor in degrees Celsius; NaN when it cannot be read."""


class Guard:
    """Lights an LED while the processor is hotter than a limit.

    Without a reading the LED is dark and the guard has failed.
    """

    outputs = {
        "temperature_c": "f64 degC",
        "hot": "bool",  # what the LED shows
    }
    parameters = {"limit_c": "f64 degC", "led_pin": "u32"}

    def execute(self):
        self.temperature_c = cpu_temp_c()
        self.hot = self.temperature_c > self.limit_c  # a NaN exceeds nothing
        if isnan(self.temperature_c):
            self.health = "failed"
        hw_write_gpio(self.led_pin, self.hot)
