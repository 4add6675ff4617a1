"""FARS as NHTSA publishes it: CrashAPI, and the yearly CSV tables."""
