"""The benchmark: packages and pages of all crashes, releases, exports.

Belongs here: everything published for others, made from the warehouse and from stored crashes.
"""
