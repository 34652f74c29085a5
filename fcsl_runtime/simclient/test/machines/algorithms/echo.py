class Echo:
    """Sums what it is given, and asks for a change of state where the sum is large."""

    inputs = {"vec": "f64[3]"}
    outputs = {"sum": "f64", "copy": "f64[3]", "count": "u64", "transition_request": "TransitionRequest"}
    parameters = {"gain": "f64", "fixed": "f64"}
    state = {"total": "f64"}

    def execute(self):
        self.sum = self.gain * (self.vec[0] + self.vec[1] + self.vec[2])
        self.copy = self.vec
        self.total += self.sum
        self.count += 1
        if self.sum > 10.0:
            self.transition_request = "GO"
        elif self.sum < -10.0:
            self.transition_request = "STOP"
