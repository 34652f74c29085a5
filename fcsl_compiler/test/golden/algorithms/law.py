from fcsl_builtins import clamp, dot, f32, i64

N = 3
WEIGHTS = [0.1, 0.5, 0.25]


def weighted(rate: "f64[3]", gain: "f64") -> "f64":
    return gain * dot(WEIGHTS, rate)


class Law:
    """One of everything that the compiler writes out.

    Records, start, a helper, an array constant, a library call, a fault.
    """

    inputs = {"rate": "f64[N] rad/s", "dt": "f64 s", "echo": "i32", "word": "Health"}
    outputs = {
        "torque": "f64 N*m",  # about the first axis
        "history": "f32[2][2]",
        "count": "i32",
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "gain": "f64 in 0..10",  # of the sum
        "limits": "f64[2] N*m in -2.5..",  # least, greatest
        "step": "i32 in ..100",
    }
    state = {"sum": "f64 rad", "index": "u32"}

    def start(self):
        self.sum = self.limits[0]

    def execute(self):
        self.sum += weighted(self.rate, self.gain) * self.dt
        self.torque = clamp(self.sum, self.limits[0], self.limits[1])
        self.history[self.index] = [f32(self.torque), 0.5]
        self.index = (self.index + 1) % 2
        self.count = self.echo + self.step
        total = 0
        for i in range(1, N):
            for j in range(i):
                total += i // (j + 1)
        if self.torque == self.limits[1] and not 0 < i64(self.count) <= total < 100:
            self.transition_request = "REST"
        self.health = "degraded" if self.word != "nominal" else "nominal"
