"""The simulator against measurement: crashes with event data recorders, staged collisions, closed forms.

Belongs here: reading measured crashes, setting them up for the simulator, and comparing its results with what was
measured and beside planar plastic momentum. Does not belong here: physics; that is :mod:`trace_dag.simulation`'s.
Crashes are simulated on flat, dry ground, by the embedded back-end and its ordinary contact: only the values that a
crash's table leaves free are fitted.
"""
