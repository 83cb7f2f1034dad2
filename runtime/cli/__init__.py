"""The command line of the runtime: `twinscrew` and the commands that a boat needs."""
