"""The storage root and what keeps files on it whole: atomic writes, checksums, locks, what disks report."""
