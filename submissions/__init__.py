"""Submissions, and the assignments they are marked against. Files are read and validated here; nothing is run."""
