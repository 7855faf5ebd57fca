"""Results of gradings: criteria, recordings and plots, and overrides by staff."""
