"""The web server: pages, the API and metrics over HTTP."""
