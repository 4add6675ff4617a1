"""How the bundled sample is made: a fictional town, crashes of known true motion, the reports a coder would write.

Nothing here imports ``trace_dag``: the truth must not come from the code it is there to judge.
"""
