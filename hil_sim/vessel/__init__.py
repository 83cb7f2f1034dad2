"""Vessels of six degrees of freedom: parameters, state, dynamics."""
