"""What a course has set: its assignments as they were frozen, who may submit when, whose names are hidden."""
