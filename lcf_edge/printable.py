"""Text from outside, made safe for a terminal."""


def printable(text: str, most: int = 500) -> str:
    """One line in which nothing is left that a terminal would obey, as ESC, and no more than ``most`` characters."""
    shown = text if len(text) <= most else f"{text[: most - 1]}…"
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in shown)
