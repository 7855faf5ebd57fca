"""The sandbox: the processes that run all student code, and the layers that isolate them."""
