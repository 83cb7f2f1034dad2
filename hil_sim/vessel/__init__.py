"""The 6-DoF vessel."""
