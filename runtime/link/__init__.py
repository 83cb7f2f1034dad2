"""The link to the autopilot: MAVLink, from thrust to paddles and back."""
