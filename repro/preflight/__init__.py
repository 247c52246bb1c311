"""What a scene will be: its model, mesh and numbers, simplifications that fail, and its cost."""
