"""Source blocks: what the devices of the board measure. One for each, because an invalid channel fails its instance."""


class Imu:
    outputs = {
        "gyro": "f64[3] rad/s",
        "accel": "f64[3] m/s^2",  # specific force: up while it stands
    }

    def execute(self):
        pass


class Battery:
    outputs = {"voltage": "f64 V"}

    def execute(self):
        pass


class RangeFinder:
    outputs = {"distance": "f64 m"}  # to the ground

    def execute(self):
        pass


class RemoteControl:
    outputs = {"sticks": "f64[8]"}  # from -1 to 1; rc.py says which is which

    def execute(self):
        pass
