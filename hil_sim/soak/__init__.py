"""Long runs with faults at random: what grows, what leaks, what breaks."""
