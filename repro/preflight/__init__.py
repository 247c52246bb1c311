"""Checks of a scene before it is run: its model, mesh, numbers, simplifications and cost."""

#: Processor time (s) of a run and a finer one together, if they are compared. Base to 19.4 h needs
#: 5 s in fast, 52 s in paper.
COMPARISON_TIME = 120.0
