"""Shared ground of all rooms: outcomes and errors, units and the one frame, settings, storage, network, messages."""
