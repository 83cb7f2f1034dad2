"""From tracks to thrust rates."""
