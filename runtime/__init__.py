"""The part of twinscrew that is on the boat: LiDAR and odometry in, thrust out."""
