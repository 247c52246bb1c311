"""Pores, bodies, meshes and runs that cases, claims, errata, hard cases and benchmarks share: defined once."""
