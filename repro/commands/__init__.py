"""The commands of the command line, one a module.

Each has ``add(commands)``, which adds its parser with ``set_defaults(call=...)``; what is called takes the parsed
arguments and returns the exit status.
"""

from repro.commands import check, compare, run, scene, sweep

COMMANDS = (run, scene, check, compare, sweep)
