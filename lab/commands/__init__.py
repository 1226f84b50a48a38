"""The subcommands of `python -m lab`."""
