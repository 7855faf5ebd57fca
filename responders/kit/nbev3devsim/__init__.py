"""Modules for responders that replace the notebook's simulator widget."""
