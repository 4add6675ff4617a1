"""The estimator that asks a language model which approach each vehicle came on.

Belongs here: the prompt and its data, the answer and its checks, asking (through litellm, any provider), storing
answers, budget and rate. Does not belong here: turning a choice into states, which the solver does for every estimator.
"""
