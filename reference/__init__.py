"""Ways to know the answer that do not trust `repro`, and never import it."""
