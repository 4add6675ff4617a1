"""Reports with one thing changed: a mutation test of the verdict.

Belongs here: pure functions from a report to a changed report, and the list of them. A package of its own beside the
other controls since each thing of a report can be said in several places, which is a subject by itself. Does not
belong here: running the flow on what comes out (:mod:`lab.changed_reports.rows`).
"""
