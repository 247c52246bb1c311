"""What every room of the verification is made of: checks, the registry of cases, the driver, the writers, mutants."""
