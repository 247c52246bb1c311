"""Independent solutions for comparison with `repro`. No module imports it."""
