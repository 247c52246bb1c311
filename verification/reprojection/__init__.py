"""Reprojection (30)-(34) and the transfer to a new mesh (3.5): what is conserved, what is reproduced."""
