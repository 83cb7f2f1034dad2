"""What makes a world and its vessels go: in step, or in real time."""
