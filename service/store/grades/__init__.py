"""What came of gradings: results, recordings and plots, and what instructors set by hand beside them."""
