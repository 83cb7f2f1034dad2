"""The training environment, the agents and their evaluation."""
