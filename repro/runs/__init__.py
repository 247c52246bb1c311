"""A run on the disk: recorder, checkpoint, folder, progress, provenance."""

#: Seconds of wall time between checkpoints.
INTERVAL = 60.0
