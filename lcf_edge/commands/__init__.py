"""What each command does, one module a command; ``command_line`` reads the arguments and prints."""
