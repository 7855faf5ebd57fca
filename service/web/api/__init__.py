"""The API below ``/api/v1``: one module for each subject, each with a ``router``."""
