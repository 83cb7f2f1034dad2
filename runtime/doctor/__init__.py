"""The doctor: checks whether a machine, its files and its connections are fit to run a boat."""
