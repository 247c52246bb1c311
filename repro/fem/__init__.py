"""Finite elements: meshes, their generation, assembly, linear solvers, transfer between meshes. No scene in here."""
