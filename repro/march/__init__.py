"""Time stepping: the paper's updates, the midpoint rule with error control, and their loop."""
