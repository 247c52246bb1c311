"""A run on the disk: recorder, checkpoint, folder, progress, provenance."""
