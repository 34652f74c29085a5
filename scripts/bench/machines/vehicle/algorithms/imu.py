class Imu:
    """The inertial measurement unit: a source block, whose outputs the host writes."""

    outputs = {
        "gyro": "f64[3] rad/s",  # body axes
        "accel": "f64[3] m/s^2",  # specific force, body axes
    }

    def execute(self):
        pass
