"""The learners, one readable file an algorithm, on shared encoders, buffer and loop."""
