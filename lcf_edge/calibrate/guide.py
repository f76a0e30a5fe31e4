"""Prompts and progress for the person at the terminal, on standard error."""

import os
import sys


class Guide:
    """Prompts, one line each, and a last line that changes, on a terminal alone."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr.isatty()
        self._shown = ""

    def say(self, text: str) -> None:
        """One line that stays."""
        self._write(self._cleared() + text + "\n")

    def progress(self, text: str) -> None:
        """In place of the last progress."""
        if self._on_terminal and text != self._shown:
            columns = os.get_terminal_size(sys.stderr.fileno()).columns or 80
            cleared, self._shown = self._cleared(), text  # before it is: Ctrl-C may come at any moment
            self._write(cleared + text[: columns - 1])

    def end(self) -> None:
        """No more progress."""
        self._write(self._cleared())

    def _cleared(self) -> str:
        shown, self._shown = self._shown, ""
        return "\r\x1b[K" if shown else ""

    def _write(self, text: str) -> None:
        if text:
            sys.stderr.write(text)
            sys.stderr.flush()
