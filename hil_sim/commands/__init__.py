"""The simulator's commands, one file each."""
