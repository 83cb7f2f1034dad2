"""The last checks before the propellers."""
