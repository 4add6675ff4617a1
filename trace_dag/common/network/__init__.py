"""The one network boundary: HTTP with retries and a rate for all processes of a machine, and alerts sent by it."""
