"""Configuration, pipeline, loop, recorder, replay and the command line."""
