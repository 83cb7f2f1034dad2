"""The sea: waves, wind and current."""
