"""Ground stations: what they order, and what they are shown."""
