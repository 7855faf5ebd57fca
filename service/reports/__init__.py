"""Output of grades for people and programs: pages, tables, texts and plots."""
