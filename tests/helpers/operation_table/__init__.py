"""The operations of ``service/operations`` with requests by page, API and command, a module for each subject."""
