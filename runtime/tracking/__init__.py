"""From objects to tracks."""
