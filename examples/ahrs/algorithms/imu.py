class Imu:
    """The inertial measurement unit: a source block.

    The host writes its outputs, through the sensor channels `imu.gyro` and `imu.accel`.
    """

    outputs = {
        "gyro": "f64[3] rad/s",  # angular velocity of the body, in body axes
        "accel": "f64[3] m/s^2",  # specific force, in body axes: +g upward at rest
    }

    def execute(self):
        pass
