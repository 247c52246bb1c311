"""The coupled loop: the whole run against its averaged pore, special cases with a known answer, what is conserved, the
order in the time step, and what must not matter."""
