"""What is fixed around a vessel: the static map, charts, the ways that it leaves open."""
