"""Waves and wind."""
