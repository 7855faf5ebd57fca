"""Runs and checks for a notebook whose cells run elsewhere: the command of the local engine, and jobs of a server."""
