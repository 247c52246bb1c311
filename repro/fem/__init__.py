"""Finite elements: meshes and their generation, assembly, solvers, transfer. No scene in here."""
