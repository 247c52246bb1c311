"""What a scene will be: what it models, its mesh, its numbers, where its simplifications fail, what it costs."""
