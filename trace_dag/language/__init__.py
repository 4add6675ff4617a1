"""Language models: the estimator that asks one, and narratives that one reads.

Included: prompts, answers and their checks, asking through litellm, stored answers, budget and rate. Excluded: turning
a choice into states, which the solver does for every estimator.
"""
