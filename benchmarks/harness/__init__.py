"""What tests and benchmarks share: a database server, harm done to a service, people who copy.

Neither of the two imports the other.
"""
