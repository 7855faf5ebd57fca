"""How fast Robomark is, beside what it should be; run with ``make bench``. Nothing here is a test."""
