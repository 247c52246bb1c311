"""What each choice costs and what it changes: ``python -m verification.audit`` prints the table and writes
``verification/report/audit.json``.

The paper's modelling and numerical choices, one changed at a time: base in the paper's preset to 19.2 h against the
same run with the change, at the same element size and step. ``effect`` is the difference of two whole runs. Two runs
that remesh at different moments differ by what two meshes differ by, in velocity ten times more than in shape: so the
other run's last shape is solved in on the default's mesh, brought to that shape. What is left of two meshes is the row
"mesh"; ``resolved`` names the quantities that change by more than twice that. ``one_state`` is free of it: both choices
in the state of the default at its end, flow and substrates solved in it and the shape of one step more. ``cost_ratio``
is of processor time, the median of runs in turn.
"""
