"""Benchmarks that print figures: functions () -> dict, found as entry points."""
