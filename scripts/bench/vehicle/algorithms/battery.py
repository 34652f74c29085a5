"""The battery's sensor: a source block."""


class Outputs:
    voltage: "f64 V"


def execute() -> None:
    pass
