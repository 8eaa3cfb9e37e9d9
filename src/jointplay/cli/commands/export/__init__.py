"""`jointplay export`: results, joints with play or robots for other programs.

Hand results and models on: histories for other programs, joints' play for simulators, a URDF with
play. Each kind has its own options: jointplay export KIND --help.
"""
