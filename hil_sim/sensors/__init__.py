"""What a vessel's satellite receiver and inertial measurement unit tell, with their errors."""
