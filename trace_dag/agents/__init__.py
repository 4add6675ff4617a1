"""Agents under test in stored crashes, and variations of these: cases, evaluations, submissions, leaderboard.

The room lies below the warehouse and the packages, which hold its results.
"""
