"""Foreign simulators and autopilots."""
