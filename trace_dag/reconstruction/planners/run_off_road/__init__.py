"""A vehicle that runs off the road: priors of its departure, its path, the planner (FHWA: roadway departure)."""
