"""Wrong changes to tables over time, rows within steps and the preset exact, that cases of this stage must catch."""

from verification.mutants import Mutant

SUPPLY = (
    Mutant("supply-of-the-start", "repro/march/updates.py",
           says="In a step of the paper's scheme the supply is that of its start.",
           old="middle = now.time + duration / 2",
           new="middle = now.time"),
    Mutant("supply-half-way-of-the-start", "repro/march/midpoint.py",
           says="Half way through a step the supply is that of its start.",
           old="ahead = replace(grown(now, first, duration / 2), time=now.time + duration / 2)",
           new="ahead = grown(now, first, duration / 2)"),
    Mutant("supply-a-step-late", "repro/march/stepping.py",
           says="Steps go over the jumps of a table.",
           old="left = corner - now.time",
           new="left = np.inf"),
    Mutant("supply-not-yet", "repro/scene/course.py",
           says="At a jump the value before it still holds.",
           old="last = bisect_right(self.times, time) - 1",
           new="last = max(0, bisect_right(self.times, time - 1e-6) - 1)"),
    Mutant("row-of-the-end", "repro/march/midpoint.py",
           says="A row within a step has the biomass of the step's end.",
           old="part = (time - now.time) / half.duration",
           new="part = 1.0"),
    Mutant("exact-steps-of-accurate", "repro/scene/keys.py",
           says="The preset exact has the tolerance of accurate.",
           old='"tolerance": 0.00025,',
           new='"tolerance": 0.001,'),
)
