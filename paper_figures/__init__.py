"""The figures of the paper, one module each, drawn from cached runs.

`python -m paper_figures` writes all figures and a page about them to `paper_figures/out`. Each module in `FIGURES` has
TITLE, RUNS (the requests of `paper_figures.runs` that it reads), CLAIMS (ids), and two functions that take the folders
of these runs: `draw() -> Figure` and `caption() -> str`. If a module computes further numbers with the functions of its
claims, it lists these claims in COMPUTED.
"""

#: Additions: topics that the paper discusses without a figure.
DISCUSSED = ("discussion_biomass", "discussion_transfer", "discussion_tearing", "discussion_rheology",
             "discussion_permeable", "discussion_head", "discussion_folds")
#: In the order of the paper, followed by the additions.
FIGURES = ("figure_2", "figure_3", "figure_4", "figure_5", "plate_1", "plate_2", "figure_6", "time_series", *DISCUSSED,
           "network", "where_biomass_sits", "settle_or_plug")
