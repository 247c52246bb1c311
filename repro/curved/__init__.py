"""The same stages on few curved triangles: what ``numerics.elements = "quadratic"`` and ``"cubic"`` are made of.

Geometry, velocity, concentrations and the places of the material are quadratic on triangles with six nodes (corners,
then the middles of the edges 01, 12, 20); head and growth pressure are linear (Taylor-Hood). The interface is a chain
of parabolic arcs that the growth's displacement moves. Velocity and concentrations may be cubic on the same triangles,
the head quadratic then (:mod:`repro.curved.fields`). Modules are named as their linear counterparts in :mod:`repro`.
"""
