"""A machine that answers while one turns its knobs: budget and one run, at once, then exactly.

`state` says what can be changed and by how much, `answer` computes, `workers` has it computed in
processes of their own, `server` offers the page.
"""
