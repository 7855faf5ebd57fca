"""The replay of a grade's trials, or of one run: its data, and the page that plays it."""
