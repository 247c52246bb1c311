"""Mesh motion (3.5), (35): what moves with the aggregate, and how; that no triangle turns over; when to remesh."""
