"""The barometer: a source block."""


class Outputs:
    altitude: "f64 m"


def execute() -> None:
    pass
