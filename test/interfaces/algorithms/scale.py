class Scale:
    inputs = {"x": "f64"}
    outputs = {"y": "f64 m", "pair": "i32[2]"}

    def execute(self):
        self.y = 2.0 * self.x
