"""The software-in-the-loop simulator: vessels, sea, LiDAR and autopilot."""
