"""A live page: sliders change a machine, and its error budget and a run follow.

`state` declares the controls and their ranges, `answer` computes, `workers` does so in processes of
their own, quickly first and then in full, and `server` serves the page.
"""
