"""How fast and how robust the project is, measured. ``python -m benchmarks`` runs them all."""
