"""The operations of ``service/operations`` with requests by page, API and command, one module for each subject."""
