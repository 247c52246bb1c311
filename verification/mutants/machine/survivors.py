"""Explained survivors among the machine-made mutants: data for :mod:`.record`."""

#: Reasons why survivors are equivalent to the code, by (file of repro/, lines before, lines after).
EQUIVALENT: dict[tuple[str, str, str], str] = {
    ("fem/linear.py", "dominant = np.tile((np.ones((k, k)) + k * np.eye(k)).ravel(), len(elements))",
     "dominant = np.tile((np.ones((k, k)) + k - np.eye(k)).ravel(), len(elements))"):
        "Identical orders of elimination for every system of base in the three presets. The order follows from the "
        "pattern of the entries. Their values only prevent a zero pivot of a factorisation that is not used further.",
    ("fem/elements.py", "return np.where(lost[:, None], 99.0, local)",
     "return np.where(lost[:, None], 100.0, local)"):
        "Both values lie outside of every triangle (the search ends between -2 and 3), and both move to the same point "
        "of its edge.",
    ("model/gear.py", "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros((2, 4))",
     "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros(( 1, 4))"):
        "NumPy broadcasts one row of zeros to two rows of zeros.",
    ("model/transport.py", "return self._reaction.evaluate(state.reshape(len(self.problem.kinds), -1))",
     "return self._reaction.evaluate(state.reshape(len(self.problem.kinds), - 2))"):
        "NumPy infers the length of an axis from any negative number.",
    ("model/growth.py", "MOST_ITERATIONS = 25", "MOST_ITERATIONS = 24"):
        "Identical outputs of base in the three presets, whose equilibria take at most 5, 5 and 3 iterations.",
    ("runs/folder.py", '(folder / "fields").mkdir(parents=True, exist_ok=True)',
     '(folder / "fields").mkdir(parents=False, exist_ok=True)'):
        "The folder exists already: the lock creates it with its parents.",
    ("report/run_page.py", 'several=hidden[packed["of"] > 1])', 'several=hidden[packed["of"] != 1])'):
        "There is at least one frame: without frames the function packs and shows nothing.",
}

#: Remaining survivors: (effect, reason why no test catches it).
LEFT: dict[tuple[str, str, str], tuple[str, str]] = {
    ("runs/__init__.py", "INTERVAL = 60.0", "INTERVAL = 59.0"):
        ("Checkpoints are written every 59 s, and the help states this interval.",
         "The interval is a choice. The results of a run do not depend on it."),
    ("model/transport.py", "woken = (iterate.saturations <= 0) & (predicted <= 0) & (concentrations > 0)",
     "woken = (iterate.saturations <= 0) & (predicted != 0) & (concentrations > 0)"):
        ("Newton's method starts from another fraction if a fraction was zero and its prediction is not. The solution "
         "is the same to the tolerance.", "The number of iterations in starved pores differs, and no test bounds it."),
}
