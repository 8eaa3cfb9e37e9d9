"""Commands of the command line, one module each: `add` its options, `run` it.

The modules are imported to show help, so they import what takes time only when they run.
"""
