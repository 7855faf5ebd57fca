"""``robomark assignments``: one module for each kind of command."""
