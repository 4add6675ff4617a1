"""The version of this program, for files that it writes."""

__version__ = "0.3.0"
