"""Is the solver right, and does the paper hold? A suite of pytest, and the paper judged.

evidence          checks and studies, the registry of cases, the plugin of pytest, pages and matrix
problems          pores, bodies, meshes and runs that cases share
cases             the verification cases, modules by stage; the hard cases among them
mutants           wrong changes of the code, as data; their runner; and those made by machine
store             results that are computed once
claims            the paper's claims, judged; beside them errata, switches, sensitivity, network, uncertainty
bench             time against error; beside it audit, speed, throughput
"""
