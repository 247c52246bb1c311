"""Many runs of a scene with varied keys, each in its own folder.

    design    the runs: a grid, lists, a Latin hypercube
    own_points  points of a file, a table or an array
    expected  the time and disk space of a sweep
    folder    sweep.json and the folders of the runs
    single_run  runs in a process of a sweep
    pool      runs on all cores
    cluster   runs on a Dask cluster
    table     table.csv and runs.csv
    page      summary.html
    driver    a sweep from its factors to its page
"""

#: The part of the first conductivity at which a pore counts as clogged.
CLOGGED = 0.1
