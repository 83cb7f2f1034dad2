"""Publish and subscribe: Zenoh, or in memory."""
