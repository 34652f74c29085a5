"""The vehicle's sensors: a source block, whose outputs the host writes (sensor channels `altitude` and `velocity`)."""


class Outputs:
    pos_z: "f64 m"  # altimeter, height above ground
    vel_z: "f64 m/s"  # Doppler velocimeter, positive upward


def execute() -> None:
    pass
