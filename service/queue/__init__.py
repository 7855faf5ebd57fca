"""Who grades when: the broker, the workers, and the self-test that each must pass."""
