"""The verification of the solver, a pytest suite, and the judgement of the paper's claims.

evidence          checks and studies, the registry of cases, the plugin of pytest, pages and matrix
problems          pores, bodies, meshes and runs that cases share
cases             the verification cases, modules by stage; the hard cases among them
mutants           wrong changes of the code, as data; their runner; and machine-made ones
store             results that are computed once
claims            the paper's claims and their verdicts; also errata, switches, sensitivity, network, uncertainty
bench             time against error; also audit, speed, throughput
"""
