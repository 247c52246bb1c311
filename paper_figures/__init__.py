"""The figures of the paper, one module each, drawn from cached runs."""
