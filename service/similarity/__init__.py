"""Similarity of submissions, in their source and in their robots' behaviour. For staff, never for marks."""
