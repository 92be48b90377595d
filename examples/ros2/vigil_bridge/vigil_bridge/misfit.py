"""What ends the bridge with a sentence for its user."""


class Misfit(Exception):
    """Parameters, topics or messages that do not fit each other."""
