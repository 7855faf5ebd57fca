"""``robomark assignments``, a module for each kind of command."""
