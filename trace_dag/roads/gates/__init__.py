"""The checks that a road map has to pass, measured on the stored file."""
