%%sim_magic -b Simple_Shapes -OAHWR
print("Hello from my own cell")
