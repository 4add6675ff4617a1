"""Motion up to the first contact: paths, manoeuvres, speeds, and the solver that joins them."""
