"""FARS codes and what they mean, in one place.

Belongs here: the table of all codes in plain words (``codes.csv``) and its reader, which checks that a code exists in
its year (:mod:`table`); the elements by name, with the codes used in rules (:mod:`elements`); and the bodies of types
of vehicles (:mod:`bodies`). Source: FARS Analytical User's Manual, 1975-2023, NHTSA; checked against NHTSA's code list
of 2014 to 2023. Does not belong here: the meaning of codes as coverage classes (:mod:`trace_dag.crash.classes`) or in a
reconstruction (:mod:`trace_dag.crash.derive`).
"""
