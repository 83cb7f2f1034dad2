"""`twinscrew perceive`: point cloud files from elsewhere, segmented on a desk."""
