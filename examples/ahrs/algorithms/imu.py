"""The inertial measurement unit: a source block, whose outputs the host writes (sensor channels `imu.gyro`, `imu.accel`)."""


class Outputs:
    gyro: "f64[3] rad/s"  # angular velocity of the body, in body axes
    accel: "f64[3] m/s^2"  # specific force, in body axes: +g upward at rest


def execute() -> None:
    pass
