"""What students may try: each function is one attack, run inside a child as a student's code.

An attack returns something true when it got through; an error, nothing, or its own death mean that it did not.
"""
