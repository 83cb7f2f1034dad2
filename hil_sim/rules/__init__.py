"""Whether vessels kept the rules of the road: two judges, how far they agree, and drawn pages."""
