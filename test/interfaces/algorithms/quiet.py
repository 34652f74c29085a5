class Quiet:
    """No outputs at all: its message tells its health."""

    def execute(self):
        pass
