"""Questions asked of stored crashes: controls, comparisons, agents in the place of drivers, variations.

Belongs here: work over many crashes that have been run, and its stored tables. Does not belong here: the measures
themselves, which are in the domain packages.
"""
