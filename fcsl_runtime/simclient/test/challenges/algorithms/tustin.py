from fcsl_builtins import clamp, max, min


class Integrator:
    """Tustin's rule with a reset and limits; a top limit below the bottom limit is taken for it."""

    inputs = {"x": "f64", "reset": "bool", "initial": "f64", "top": "f64", "bottom": "f64"}
    outputs = {"y": "f64"}
    parameters = {"step": "f64"}
    state = {"last_x": "f64"}

    def execute(self):
        integral = self.y + (self.x + self.last_x) * 0.5 * self.step
        low = min(self.bottom, self.top)
        high = max(self.bottom, self.top)
        self.y = clamp(self.initial if self.reset else integral, low, high)
        self.last_x = self.x
