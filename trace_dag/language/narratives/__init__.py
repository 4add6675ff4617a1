"""Crash narratives as reports: a language model reads fields into the record, each with the words it was read from.

Belongs here: the vocabulary (``words.toml``), the two questions to a model, the check of every field against its
quotation, records of the supported fields, and the location of a crash from two street names. Does not belong here:
asking a provider (:mod:`trace_dag.language.client`) and completing a record (:mod:`trace_dag.crash`).
"""
