"""Commands of ``robomark``: one module for each group."""
