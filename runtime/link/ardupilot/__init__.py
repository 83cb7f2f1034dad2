"""ArduPilot Rover as the autopilot of a twin-propeller boat."""
