from fcsl_builtins import f64


class Desk:
    """The desk of the operator by the clock. A negative time never comes.

    The switch is on from `run_s` to `stop_s`. The target is 0, and from each of `times` (s, in rising order) on that
    of `targets`.
    """

    inputs = {"time_ns": "i64 ns"}
    outputs = {"run": "bool", "target": "f64 m"}
    parameters = {"run_s": "f64 s", "stop_s": "f64 s", "times": "f64[4] s", "targets": "f64[4] m"}

    def execute(self):
        now = f64(self.time_ns) * 1e-9
        self.run = 0.0 <= self.run_s <= now and not 0.0 <= self.stop_s <= now
        self.target = 0.0
        for i in range(4):
            if 0.0 <= self.times[i] <= now:
                self.target = self.targets[i]
