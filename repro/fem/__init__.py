"""Finite elements: meshes and their generation, assembly, solvers, transfer. They know no scene."""
