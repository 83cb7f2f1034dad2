"""Recordings: rosbag2 in MCAP, written while the boat sails and read again; others' bags, too."""
