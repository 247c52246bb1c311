"""A run on the disk.

    execution     run a scene into a folder, or resume the run in a folder
    recorder      the files that a run writes
    history       its rows, the list of its fields and its counts so far
    state_arrays  its present state as plain data and arrays
    checkpoint    checkpoint files
    folder        the run's own files in its folder
    integrity     checks files by their SHA-256
    scripts       the functions of Python: run, resume, load
    status, machine, progress, interrupts
"""

#: Seconds of wall time between checkpoints.
INTERVAL = 60.0
