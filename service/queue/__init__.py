"""Queue processing: the broker, the workers, and the self-test that each worker must pass."""
