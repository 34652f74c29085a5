"""Recorded, and no topic."""


class Outputs:
    secret: "Secret"


def execute(y: Outputs) -> None:
    y.secret.key += 1
