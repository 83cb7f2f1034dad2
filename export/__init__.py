"""Actors as self-contained ONNX files."""
