"""The benchmark: packages and pages of all crashes, releases, exports.

Belongs here: what is handed on to others, made from the warehouse and from stored crashes.
"""
