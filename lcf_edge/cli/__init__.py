"""The commands, one module a command; ``arguments`` is what they take, ``command_line`` reads it and prints."""
