"""From a point cloud to objects."""
