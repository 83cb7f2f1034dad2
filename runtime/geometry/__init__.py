"""Angles, poses and frames: pure functions."""
