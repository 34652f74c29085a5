from fcsl_builtins import hw_read_adc, hw_read_gpio, hw_read_u32, hw_write_gpio, hw_write_u32


class Pins:
    """Hardware, in both directions."""

    outputs = {
        "level": "bool",
        "raw": "u32",  # counts of the ADC
        "word": "u32",  # of a register
    }

    def execute(self):
        self.level = hw_read_gpio(3)
        self.raw = hw_read_adc(1)
        self.word = hw_read_u32(0)
        hw_write_gpio(4, not self.level)
        hw_write_u32(2, self.raw ^ self.word)
