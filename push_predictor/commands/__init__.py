"""The sub-commands of the command line. Each module has `add_parser` and does its heavy imports when it runs."""
