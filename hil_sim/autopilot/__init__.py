"""A simulated autopilot that behaves as ArduPilot Rover was measured to."""
