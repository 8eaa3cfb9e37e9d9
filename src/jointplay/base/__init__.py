"""Foundations: errors, units, inputs declared by fields, tables, files.

Also signals, standard streams, worker processes and the compiler. Nothing here knows of mechanics.
"""
