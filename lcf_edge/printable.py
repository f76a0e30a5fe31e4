"""Text from outside, made safe for a terminal."""


def printable(text: str, most: int = 500) -> str:
    """Return one line without control characters such as ESC, of ``most`` characters at most."""
    shown = text if len(text) <= most else f"{text[: most - 1]}…"
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in shown)
