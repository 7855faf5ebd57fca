"""The pages and the measures that are served over HTTP."""
