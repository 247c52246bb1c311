"""What users read, verified by tests: the wrong changes that these must catch."""
