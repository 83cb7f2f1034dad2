"""The paper's experiments: many episodes, several methods, the same episodes for all."""
