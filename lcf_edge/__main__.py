"""``python -m lcf_edge`` is ``lcf-edge``."""

from lcf_edge.cli.command_line import program

if __name__ == "__main__":
    program()
