"""Checks of a scene before it is run: its model, mesh, numbers, simplifications and cost."""
