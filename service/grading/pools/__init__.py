"""Pools: values of criteria that are defined over a fixed set of trials, and bounds on them from the first few."""
