%%sim_magic -b Simple_Shapes -O
# The program is loaded and not run, and the panels are as they are.
print("Hello from my own cell")
