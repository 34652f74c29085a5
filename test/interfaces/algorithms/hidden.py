class Hidden:
    """Recorded, and no topic."""

    outputs = {"secret": "Secret"}

    def execute(self):
        self.secret.key += 1
