"""Faults on purpose: what goes wrong when, what the boat does about it, and what was promised."""
