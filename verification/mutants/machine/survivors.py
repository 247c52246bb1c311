"""Survivors among the mutants made by machine that are explained: data, read by :mod:`.record`."""

#: Survivors that no test can tell from the code, each with the reason, by (file of repro/, line or lines as they are,
#: as they become).
EQUIVALENT: dict[tuple[str, str, str], str] = {
    ("fem/elements.py", "EDGE_DEGREES = {1: 2, 2: 6, 3: 9}", "EDGE_DEGREES = {1: 3, 2: 6, 3: 9}"):
        "The same rule: Gauss' two points, which scikit-fem gives for degree 2, are exact to degree 3.",
    ("fem/linear.py", "dominant = np.tile((np.ones((k, k)) + k * np.eye(k)).ravel(), len(elements))",
     "dominant = np.tile((np.ones((k, k)) + k - np.eye(k)).ravel(), len(elements))"):
        "Identical orders of elimination for every system of base in the three presets: they follow from which entries "
        "there are, and the values only keep the factorisation, which is thrown away, from a zero pivot.",
    ("fem/transfer.py", "return np.where(lost[:, None], 99.0, local)",
     "return np.where(lost[:, None], 100.0, local)"):
        "Either is outside of every triangle, places found are from -2 to 3, and is brought back to the same place of "
        "its edge.",
    ("model/flow.py", "@dataclass(frozen=True, eq=False)", "@dataclass(frozen=True, eq=True)"):
        "Bubble has no fields and is not compared, nor a key of anything: it is called.",
    ("model/flow.py", "@dataclass(frozen=True, eq=False) class Bubble:", "class Bubble:"):
        "Bubble has no fields: what the decorator makes of it, but for the text that shows it, a class has by itself.",
    ("model/gear.py", "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros((2, 4))",
     "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros(( 1, 4))"):
        "A row of zeros, added to two rows, is two rows of zeros.",
    ("model/transport.py", "return self._reaction.evaluate(state.reshape(len(self.problem.both), -1))",
     "return self._reaction.evaluate(state.reshape(len(self.problem.both), - 2))"):
        "numpy takes any negative length of one axis for the one that is left.",
    ("report/quantities.py", 'is_new_mesh = run.series.get("remeshed", run.times * np.nan) == 1',
     'is_new_mesh = run.series.get("remeshed", run.times * np.nan) >= 1'):
        "The column is 0 or 1, and NaN is neither.",
    ("model/growth.py", "MOST_ITERATIONS = 25", "MOST_ITERATIONS = 24"):
        "Identical outputs of base in the three presets, whose equilibria take 5, 5 and 3 iterations at most.",
    ("runs/folder.py", '(folder / "fields").mkdir(parents=True, exist_ok=True)',
     '(folder / "fields").mkdir(parents=False, exist_ok=True)'):
        "The folder is there already: it is made with those above it for its lock.",
    ("report/run_page.py", 'several=hidden[packed["of"] > 1])', 'several=hidden[packed["of"] != 1])'):
        "There is one frame or more: without any, nothing is packed, and nothing shown.",
}

#: Remaining survivors: (effect, reason why no test catches it).
LEFT: dict[tuple[str, str, str], tuple[str, str]] = {
    ("runs/__init__.py", "INTERVAL = 60.0", "INTERVAL = 59.0"):
        ("Checkpoints are written every 59 s, and the help says so.",
         "It is a choice; what a run makes does not depend on it."),
    ("model/transport.py", "woken = (iterate.saturations <= 0) & (predicted <= 0) & (concentrations > 0)",
     "woken = (iterate.saturations <= 0) & (predicted != 0) & (concentrations > 0)"):
        ("Newton's method goes on from another fraction where one was zero and another is predicted; what it ends at "
         "is the same to its tolerance.", "It takes more or fewer iterations in starved pores, which nothing bounds."),
}
