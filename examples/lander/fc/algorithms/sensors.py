class Sensors:
    """The vehicle's sensors: a source block.

    The host writes its outputs, through the sensor channels `altitude` and `velocity`.
    """

    outputs = {
        "pos_z": "f64 m",  # altimeter, height above ground
        "vel_z": "f64 m/s",  # Doppler velocimeter, positive upward
    }

    def execute(self):
        pass
