"""Recorded detections of real sensors: read them, track them, score the tracks."""
