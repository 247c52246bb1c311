"""Survivors that no test can tell from the code, each with the reason; and survivors that are left, each with its
effect and why there is no test. By (file of repro/, line or lines as they are, as they become)."""

EQUIVALENT: dict[tuple[str, str, str], str] = {}

#: (effect, why no test)
LEFT: dict[tuple[str, str, str], tuple[str, str]] = {}
