"""Mesh motion (3.5), (35): what moves with the aggregate, and how; that no triangle turns over; when to remesh."""

from verification.mesh_motion import closed_forms, cross_code, properties  # noqa: F401
