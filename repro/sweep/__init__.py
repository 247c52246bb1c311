"""Many pores: a scene with keys varied, each run in a process and a folder of its own.

    design    the runs: a grid, lists, a Latin hypercube
    state     the folder: what is wanted, what is there
    task      one run, whole or not at all
    server    a process that makes runs, each in a fork of its own
    pool      runs on all cores
    cluster   runs on a Dask cluster
    table     table.csv and runs.csv
    picture   lines and dots as SVG
    page      summary.html
    making    all of it, for scripts too
"""
