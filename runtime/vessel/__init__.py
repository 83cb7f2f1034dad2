"""One vessel: everything between its messages and its propellers, and the clocks that drive it."""
