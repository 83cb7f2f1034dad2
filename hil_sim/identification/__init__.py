"""Identification of a vessel from recorded trials."""
