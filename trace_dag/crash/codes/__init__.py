"""FARS codes and what they mean, in one place.

Belongs here: the tables, one per FARS element, in plain words of ours (:mod:`crash`, :mod:`vehicle`, :mod:`events`,
:mod:`bodies`) and the check that a code exists in its year (:mod:`table`). Source: FARS Analytical User's Manual,
1975-2023, NHTSA; checked against NHTSA's code list of 2014 to 2023. Does not belong here: what codes amount to as
coverage classes (:mod:`trace_dag.crash.classes`) or in a reconstruction (:mod:`trace_dag.crash.derive`).
"""
