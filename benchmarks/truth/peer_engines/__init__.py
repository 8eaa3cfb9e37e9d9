"""Other engines on the mechanisms of this package; `benchmarks/truth/peers.py` compares them.

One module per engine, imported only if the engine is installed (`common.missing`).
"""
