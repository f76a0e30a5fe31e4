"""Prompts and progress for the person at the terminal, on standard error."""

import os
import sys


class Guide:
    """Prompts, one line each; on a terminal also a last line that shows progress."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr.isatty()
        self._shown = ""

    def say(self, text: str) -> None:
        """Print a line that stays."""
        self._write(self._cleared() + text + "\n")

    def progress(self, text: str) -> None:
        """Show progress, in place of the last one shown."""
        if self._on_terminal and text != self._shown:
            columns = os.get_terminal_size(sys.stderr.fileno()).columns or 80
            cleared, self._shown = self._cleared(), text  # set before it is shown: Ctrl-C may come at any moment
            self._write(cleared + text[: columns - 1])

    def end(self) -> None:
        """Clear the progress line."""
        self._write(self._cleared())

    def _cleared(self) -> str:
        shown, self._shown = self._shown, ""
        return "\r\x1b[K" if shown else ""

    def _write(self, text: str) -> None:
        if text:
            sys.stderr.write(text)
            sys.stderr.flush()
