"""A MAVLink autopilot that behaves as ArduPilot Rover."""
