from __future__ import annotations

from fcsl_builtins import f64, hw_read_adc, hw_write_gpio, u32

FLAT: Pose = Pose([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], True)
COEFFICIENTS = [0.5, 0.25]


def mirror(p: Pose, s: f64) -> Pose:
    q = p
    q.position[0] = -s * p.position[0]
    q.valid = not p.valid
    return q


def heavier(a: Target, b: Target) -> Target:
    return a if a.weight > b.weight else b


class Navigation:
    """Structs, slices, unpacking and bits: every kind of value that has parts."""

    inputs = {
        "measured": "Pose",  # of the vehicle
        "targets": "Target[3]",
        "n": "i32",
        "word": "u32",
    }
    outputs = {
        "pose": "Pose",  # mirrored
        "best": "Target",
        "column": "f64[2] m",
        "bits": "u32",
        "sum": "f64 m",
        "half": "f32",
    }
    parameters = {"home": "Pose", "matrix": "f64[2][2]", "gain": "f32"}
    state = {"m": "f64[2][3]", "history": "Target[2][2]", "line": "f64[5]"}

    def start(self):
        self.history[0, 0].pose = self.home

    def execute(self):
        self.pose = mirror(self.measured, 2.0)
        self.best = heavier(self.targets[0], self.targets[self.n])
        self.history[0, 1] = Target(self.measured, weight=2.5)
        self.history[1, self.n] = self.best
        self.history[1, 0].pose.position[self.n] = 7.0
        self.m[0] = self.measured.position
        self.m[1, 0:2] = self.measured.position[1:]
        self.column = self.m[:, 1]
        self.m[:, 2] = self.column + self.m[:, 0]
        a, b, c = self.measured.position
        a, b = b, a
        self.line[0], self.line[1] = a, b
        self.line[1:4] = self.line[0:3]
        self.line[2:] += [1.0, COEFFICIENTS[self.n], c]
        low, high = self.line[-2:]
        self.sum = low + high + self.matrix[1, 0]
        self.bits = (self.word << 4 | 3) & ~u32(1) ^ u32(0xF0) >> self.n
        self.half = self.gain * (1.0 if self.measured.valid else 2) - (3.0 if self.measured.valid else 1)
        if self.n == 1:
            self.pose = FLAT
        counts = hw_read_adc(self.word)
        self.column[0] += f64(counts)
        hw_write_gpio(7, counts > 2048)
