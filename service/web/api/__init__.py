"""What programs are answered, below ``/api/v1``: a module a subject, each with a ``router``."""
