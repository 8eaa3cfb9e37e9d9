"""`jointplay study`: many runs: sweeps, ISO 9283, wear, dynamics, hunting.

Run many variations of a scenario or robot and evaluate them together. Each kind has its own
options: jointplay study KIND --help.
"""
