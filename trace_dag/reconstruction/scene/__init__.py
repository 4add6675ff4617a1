"""The crash on its map: approaches, places, mapped objects and ground."""
