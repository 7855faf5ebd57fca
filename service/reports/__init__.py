"""What people and programs read of grades: pages, tables, texts and plots."""
