"""The version of this program, for whoever writes it into what they make."""

__version__ = "0.3.0"
