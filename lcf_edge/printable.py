"""Text for people: made safe for a terminal, and numbers of things."""


def printable(text: str, most: int = 500) -> str:
    """Return one line without control characters such as ESC, of ``most`` characters at most."""
    shown = text if len(text) <= most else f"{text[: most - 1]}…"
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in shown)


def counted(number: int, thing: str) -> str:
    """Return a number of things in words: ``1 view``, ``2 views``."""
    return f"{number} {thing}" + ("" if number == 1 else "s")
