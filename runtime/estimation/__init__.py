"""Where the vessel is, from a satellite receiver and an inertial measurement unit."""
