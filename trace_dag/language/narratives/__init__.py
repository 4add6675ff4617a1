"""Crash narratives as reports: a language model reads fields into the record, each with the words it was read from.

Belongs here: what can be read (``words.toml``), the two questions to a model, the check of every field against its
quotation, records of what is left, and where a crash is that a narrative places at two streets. Does not belong here:
asking a provider (:mod:`trace_dag.language.client`) and completing a record (:mod:`trace_dag.crash`).
"""
