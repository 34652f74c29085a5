SCALES = [1.0, 1.0]


class Io:
    """Reads an ADC channel (1 mV a count), a register and a pin, and drives a pin and another register. Two volts and more
    are a fault: outputs and state stay, what was written to hardware stays written."""

    parameters = {"led_pin": "u32"}
    outputs = {"volts": "f64", "level": "bool", "total": "f64"}
    state = {"turns": "i64"}

    def execute(self):
        counts = hw_read_adc(3)
        volts = f64(counts) / 1000.0
        hw_write_gpio(self.led_pin, volts > 1.0)
        hw_write_u32(0xFFFFFFFF, counts // 2)
        self.volts = SCALES[i32(volts)] * volts
        self.turns += i64(hw_read_u32(0x40000024))
        self.level = hw_read_gpio(4)
        self.total = self.volts * f64(self.turns)
