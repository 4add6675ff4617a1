"""A vehicle that strikes a person or an animal: the planner, the point of impact, the states it starts from."""
