"""Sensors beside the LiDAR: what each says becomes looks for the tracker."""
