class Baro:
    """The barometer: a source block."""

    outputs = {"altitude": "f64 m"}

    def execute(self):
        pass
