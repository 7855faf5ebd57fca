"""The commands of ``robomark``, each module a group of them."""
