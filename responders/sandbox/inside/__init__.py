"""Code that runs in the sandbox with the student's. It imports only the standard library, and no one trusts it."""
