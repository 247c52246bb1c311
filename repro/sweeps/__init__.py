"""Many pores: a scene with keys varied, each run in a process and a folder of its own.

    design    the runs: a grid, lists, a Latin hypercube
    state     the folder: what is wanted, what is there
    task      one run, in a process of its own
    preload   what such processes share
    pool      runs on all cores
    cluster   runs on a Dask cluster
    table     table.csv and runs.csv
    page      summary.html
    making    all of it, for scripts too
"""
