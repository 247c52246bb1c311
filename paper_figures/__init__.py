"""The figures of the paper, one module each, drawn from cached runs.

`python -m paper_figures` leaves all of them and a page about them in `paper_figures/out`. Each module named in
`FIGURES` has TITLE, RUNS (the requests of `paper_figures.runs` that it reads), CLAIMS (ids), and two functions that
take the folder of each of those runs: `draw() -> Figure` and `caption() -> str`. One that computes
numbers of its own, with the functions of its claims, names these in COMPUTED.
"""

#: Additions: what the paper discusses and does not show.
DISCUSSED = ("discussion_biomass", "discussion_transfer", "discussion_tearing", "discussion_rheology",
             "discussion_permeable", "discussion_head")
#: In the order of the paper, then additions.
FIGURES = ("figure_2", "figure_3", "figure_4", "figure_5", "plate_1", "plate_2", "figure_6", "time_series", *DISCUSSED,
           "network")
