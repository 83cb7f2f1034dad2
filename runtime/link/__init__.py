"""MAVLink to the autopilot."""
